//! Another renderer's pictures of a dataset against our own tracer's, view by view.
//!
//! In: a dataset with Blender's renders. Out: [`CompareFile`], which [`text`] sets in tables; and, where asked for, a folder
//! with it and a page of both pictures side by side.
//!
//! Between: `theirs` reads, `ours` renders, `geometry` compares pictures without light, `light` those with it by `tiles`;
//! `kind` says what may differ, [`bounds`] how far; `previews` and `page` show it.

pub mod bounds;
pub mod file;
mod geometry;
pub mod kind;
mod light;
mod ours;
mod page;
mod previews;
#[cfg(test)]
mod tests;
pub mod text;
mod theirs;
mod tiles;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::SceneFolder;
use mateval_scene::open::Dataset;
use mateval_scene::reference::ReferenceScene;
use mateval_scene::work_folder::{WorkFolder, check_free};
use mateval_scene::{Progress, RendererId, SceneId, json, reference_io};
use mateval_tracer::World;

use crate::error::AuditError;
use bounds::{BOUNDS, LAMBERT_TILE, OTHER_TILE};
use file::{COMPARE_FORMAT, CompareFile, ComparedDataset, LightComparison, SceneComparison, State, ViewComparison};
use geometry::{OurGeometry, TheirGeometry};
use kind::MaterialKind;
use light::ShownKinds;
use mateval_prep::render::{BLENDER, RenderFile};
use ours::OurLight;
use previews::ViewPreviews;
use theirs::{TheirView, file_check};
use tiles::Halves;

/// Its place in the output's folder.
pub const COMPARE: &str = "compare.json";

/// What to compare, and where to show it.
#[derive(Clone, Debug, Default)]
pub struct CompareOptions {
    /// The dataset's folder.
    pub dataset: PathBuf,
    /// Only these scenes; all where empty.
    pub scenes: Vec<SceneId>,
    /// Samples a pixel of each of our halves; as many as theirs where absent.
    pub samples: Option<u32>,
    /// Folder for the page; none is written where absent.
    pub out: Option<PathBuf>,
    /// Replace a comparison that is there.
    pub force: bool,
}

/// Compares. Fails where no view of any scene was rendered; a scene or view that was not is told as `missing`.
pub fn compare(options: &CompareOptions, tool: &str, progress: Progress<'_>) -> Result<CompareFile, AuditError> {
    let dataset = Dataset::open(&options.dataset)?;
    let scenes = dataset.chosen_scenes(&options.scenes)?;
    check_rendered(&dataset, &scenes)?;
    check_out(options)?;
    let work = options.out.as_deref().map(WorkFolder::start).transpose()?;
    let mut previews = Vec::new();
    let mut file = CompareFile {
        format: COMPARE_FORMAT.to_owned(),
        tool: tool.to_owned(),
        dataset: ComparedDataset {
            name: dataset.file.name.clone(),
            version: dataset.file.version.clone(),
            manifest_sha256: dataset.file.manifest_sha256.clone(),
        },
        renderer: BLENDER.to_owned(),
        bounds: BOUNDS,
        agrees: true,
        scenes: Vec::new(),
    };
    for scene in scenes {
        let place = work.as_ref().map(WorkFolder::path);
        let (found, shown) = compare_scene(&dataset.folder(&scene.id), scene, options.samples, place, progress)?;
        file.scenes.push(found);
        previews.push(shown);
    }
    let agrees = file.checks().all(|(_, _, check)| check.state == State::Agrees);
    file.agrees = agrees;
    if let Some(work) = work {
        json::write(&work.path().join(COMPARE), &file)?;
        mateval_image::store::write_whole(&work.path().join("index.html"), page::page(&file, &previews).as_bytes())?;
        work.finish()?;
    }
    Ok(file)
}

fn renderer() -> RendererId {
    RendererId::new(BLENDER).expect("our own word is an id")
}

/// The view's folder of renders, if it was finished: `render.json` is written last.
fn rendered(folder: &SceneFolder, view: &View) -> Option<PathBuf> {
    let place = folder.render(&renderer(), &view.id);
    place.join("render.json").is_file().then_some(place)
}

fn check_rendered(dataset: &Dataset, scenes: &[&SceneFile]) -> Result<(), AuditError> {
    let has_any =
        |scene: &&&SceneFile| scene.views.iter().any(|view| rendered(&dataset.folder(&scene.id), view).is_some());
    if scenes.iter().any(|scene| has_any(&scene)) {
        return Ok(());
    }
    let names: Vec<&str> = scenes.iter().map(|scene| scene.id.as_str()).collect();
    let what = format!(
        "holds no pictures by Blender of scene '{}'; run `mateval prep render DATASET --renderer blender`",
        names.join("', '")
    );
    Err(AuditError::Output { path: dataset.root.clone(), what })
}

fn check_out(options: &CompareOptions) -> Result<(), AuditError> {
    let Some(out) = &options.out else { return Ok(()) };
    let refused = |what: &str| Err(AuditError::Output { path: out.clone(), what: what.to_owned() });
    // The nearest folder above that is there: the others are still to be made.
    let above = out.ancestors().skip(1).find_map(|folder| match folder.as_os_str().is_empty() {
        true => Path::new(".").canonicalize().ok(),
        false => folder.canonicalize().ok(),
    });
    if above.is_some_and(|above| options.dataset.canonicalize().is_ok_and(|dataset| above.starts_with(dataset))) {
        return refused("would lie in the dataset, whose manifest does not list it; choose another --out");
    }
    if !out.exists() {
        return Ok(());
    }
    check_free(out, options.force, "--out")?;
    match json::read::<CompareFile>(&out.join(COMPARE)).is_ok_and(|file| file.format == COMPARE_FORMAT) {
        true => Ok(()),
        false => refused("is there and is no comparison: it is not replaced; choose another --out"),
    }
}

/// Compares the views of a scene that were rendered; writes their previews below `out`.
fn compare_scene(
    folder: &SceneFolder,
    scene: &SceneFile,
    samples: Option<u32>,
    out: Option<&Path>,
    progress: Progress<'_>,
) -> Result<(SceneComparison, Vec<ViewPreviews>), AuditError> {
    let reference = Arc::new(reference_io::read(folder)?);
    let world = World::new(reference.clone())?;
    let kinds = MaterialKind::of_surfaces(&reference);
    let tile_bound = match kinds.iter().all(|kind| *kind == MaterialKind::Lambert) {
        true => LAMBERT_TILE,
        false => OTHER_TILE,
    };
    let there: Vec<&View> = scene.views.iter().filter(|view| rendered(folder, view).is_some()).collect();
    let samples = match samples {
        _ if there.is_empty() => 0,
        Some(samples) => samples,
        None => their_samples(folder, &there)?,
    };
    let mut ours = match there.is_empty() {
        true => Vec::new(),
        false => ours::render(&world, &scene.id, &there, samples, progress)?,
    }
    .into_iter();
    let (mut views, mut previews) = (Vec::new(), Vec::new());
    let step = format!("{} compare", scene.id);
    for (at, view) in scene.views.iter().enumerate() {
        progress(&step, at, scene.views.len());
        let (Some(place), Some(light)) = (rendered(folder, view), rendered(folder, view).and_then(|_| ours.next()))
        else {
            views.push(missing(view));
            continue;
        };
        let theirs = TheirView { folder: place, size: size(view) };
        let pair = ViewPair { folder, view, reference: &reference, world: &world, kinds: &kinds, tile_bound };
        let (found, shown) = pair.compare(&light, &theirs, out.map(|out| (out, scene)))?;
        views.push(found);
        previews.extend(shown);
    }
    progress(&step, scene.views.len(), scene.views.len());
    let seeds = ours::seeds(&scene.id).map(|seed| format!("{seed:016x}"));
    let kinds = kinds.into_iter().collect::<std::collections::BTreeSet<_>>().into_iter().collect();
    let found =
        SceneComparison { scene: scene.id.clone(), kinds, tile_bound, samples_each_half: samples, seeds, views };
    Ok((found, previews))
}

fn size(view: &View) -> (usize, usize) {
    (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize)
}

/// As many samples as the view that has most.
fn their_samples(folder: &SceneFolder, views: &[&View]) -> Result<u32, AuditError> {
    let mut most = 1;
    for place in views.iter().filter_map(|view| rendered(folder, view)) {
        let render: RenderFile = json::read(&place.join("render.json"))?;
        most = most.max(render.samples_each_half);
    }
    Ok(most)
}

fn missing(view: &View) -> ViewComparison {
    let message = "the view was not rendered; run `mateval prep render DATASET --renderer blender`".to_owned();
    let checks = vec![file_check("render", State::Missing, message)];
    ViewComparison { view: view.id.clone(), checks, light: Vec::new() }
}

/// A view that both have rendered.
struct ViewPair<'a> {
    folder: &'a SceneFolder,
    view: &'a View,
    reference: &'a ReferenceScene,
    world: &'a World,
    kinds: &'a [MaterialKind],
    tile_bound: f64,
}

impl ViewPair<'_> {
    fn compare(
        &self,
        light: &OurLight,
        theirs: &TheirView,
        out: Option<(&Path, &SceneFile)>,
    ) -> Result<(ViewComparison, Option<ViewPreviews>), AuditError> {
        let ours = OurGeometry::read(self.folder, self.view, self.world)?;
        if !ours.has_size(theirs.size) {
            let (width, height) = theirs.size;
            let what =
                format!("holds pictures that are not of the camera's {width}x{height}; run `mateval prep verify`");
            return Err(AuditError::Output { path: self.folder.view(&self.view.id), what });
        }
        let mut found = ViewComparison { view: self.view.id.clone(), checks: Vec::new(), light: Vec::new() };
        let their_geometry = TheirGeometry::read(theirs, &mut found.checks);
        found.checks.extend(geometry::compare(&ours, &their_geometry));
        let shown = ShownKinds::new(&ours.instance, self.kinds, &ours.valid);
        let their_light = self.compare_lights(light, theirs, &shown, &mut found);
        let Some((out, scene)) = out else { return Ok((found, None)) };
        let mut previews = ViewPreviews::new(out, scene, &self.view.id)?;
        let both = std::iter::once(&light.rgb).chain(&light.groups).zip(&their_light);
        let both = both.filter_map(|(ours, theirs)| theirs.as_ref().map(|theirs| [ours, theirs]));
        for (light, both) in found.light.iter().zip(both) {
            previews.add_light(light, both, &shown, self.tile_bound)?;
        }
        previews.add_geometry(&ours, &their_geometry)?;
        Ok((found, Some(previews)))
    }

    /// Compares RGB, each group, and their sums; gives theirs in this order, where they could be read.
    fn compare_lights(
        &self,
        light: &OurLight,
        theirs: &TheirView,
        shown: &ShownKinds,
        found: &mut ViewComparison,
    ) -> Vec<Option<Halves>> {
        let mut all = vec![self.compare_light("rgb", None, &light.rgb, theirs, shown, found)];
        for (at, (ours, group)) in light.groups.iter().zip(&self.reference.lights).enumerate() {
            let name = Some(group.name.clone());
            all.push(self.compare_light(&format!("group_{at:02}"), name, ours, theirs, shown, found));
        }
        let there: Vec<&Halves> = all.iter().flatten().collect();
        if let Some((rgb, groups)) = there.split_first().filter(|_| there.len() == all.len()) {
            let sums = |half: fn(&Halves) -> &_| groups.iter().map(|group| half(group)).collect::<Vec<_>>();
            found.checks.push(light::sum_check("rgb_a", &rgb.a, &sums(|group| &group.a)));
            found.checks.push(light::sum_check("rgb_b", &rgb.b, &sums(|group| &group.b)));
        }
        all
    }

    /// Compares one picture of light; gives theirs, if it could be read.
    fn compare_light(
        &self,
        picture: &str,
        name: Option<String>,
        ours: &Halves,
        theirs: &TheirView,
        shown: &ShownKinds,
        found: &mut ViewComparison,
    ) -> Option<Halves> {
        match theirs.halves(picture) {
            Ok(theirs) => {
                found.checks.extend(light::same_halves(picture, &theirs));
                let (light, checks): (LightComparison, _) =
                    light::compare(picture, name, [ours, &theirs], shown, self.tile_bound);
                found.light.push(light);
                found.checks.extend(checks);
                Some(theirs)
            }
            Err(check) => {
                found.checks.push(check);
                None
            }
        }
    }
}
