//! Compares Blender's pictures of a dataset with those of the built-in tracer, view by view.
//!
//! In: a dataset with Blender's renders. Out: [`CompareFile`], which [`mod@tables`] prints; its verdict, which is kept
//! in the dataset; and, on request, a folder that holds it and a page with both pictures side by side.
//!
//! Between: `pictures` reads Blender's pictures and renders ours; `geometry` compares pictures without light, and
//! `light` compares pictures of light tile by tile, with the statistics of `tiles`. A check of light has three outcomes:
//! a fault, none, or too much noise to say; samples of ours are added while that would decide a check. [`mod@file`] states
//! which materials may differ and how far.

pub mod file;
mod geometry;
mod light;
mod page;
mod pictures;
pub mod tables;
mod tiles;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::{BuildFolder, COMPARE, SceneFolder};
use mateval_dataset::open::{Dataset, check_outside};
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::render_file::RENDER_FILE;
use mateval_dataset::verdict::{CompareCounts, VERDICT_FORMAT, VerdictFile};
use mateval_dataset::{Progress, Report, SceneId, json, reference};
use mateval_files::work_folder::{WorkFolder, check_free};
use mateval_tracer::World;

use self::file::{
    BOUNDS, COMPARE_FORMAT, CompareFile, LightComparison, MaterialKind, SamplesToDecide, SceneComparison, State,
    ViewComparison, file_check,
};
use self::geometry::{OurGeometry, TheirGeometry};
use self::light::ShownKinds;
use self::page::ViewPreviews;
use self::pictures::{OurLight, OurRender, TheirView};
use self::tiles::Halves;
use crate::error::PrepError;
use crate::recipe::MOST_SAMPLES;
use crate::render::RendererKind;

/// Samples per pixel of each half that the built-in tracer renders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampling {
    /// Until every check that they can decide is decided, and at most `BUDGET_OVER_THEIRS` times as many as Blender's:
    /// at that number an eighth of the noise is ours.
    #[default]
    UntilDecided,
    /// Until every check that they can decide is decided, and at most this number.
    AtMost(u32),
    Exactly(u32),
}

/// The budget of samples as a multiple of Blender's.
const BUDGET_OVER_THEIRS: u32 = 4;

/// What to compare, and where to write the page.
#[derive(Clone, Debug, Default)]
pub struct CompareOptions {
    pub dataset: PathBuf,
    /// Only these scenes; all where empty.
    pub scenes: Vec<SceneId>,
    /// How many samples the built-in tracer renders.
    pub samples: Sampling,
    /// Folder for the page; no page is written where absent.
    pub out: Option<PathBuf>,
    /// Replace a comparison that already exists.
    pub force: bool,
}

/// Compares the pictures of the dataset's scenes, and writes the outcomes to the dataset's `compare.json`. Scenes with
/// a photo from elsewhere are left out. A view that Blender has not rendered is reported as `missing`; fails where that
/// is every view of the others.
pub fn compare(options: &CompareOptions, tool: &str, progress: Progress<'_>) -> Result<CompareFile, PrepError> {
    let dataset = Dataset::open(&options.dataset)?;
    let mut scenes = dataset.chosen_scenes(&options.scenes)?;
    if let Some(absence) = dataset.absence().filter(|_| options.scenes.is_empty()) {
        progress(Report::Message(&absence));
    }
    for scene in scenes.extract_if(.., |scene| scene.photo.is_some()) {
        let what = format!("{}: not compared, since a scene with a photo from elsewhere is not rendered", scene.id);
        progress(Report::Message(&what));
    }
    check_rendered(&dataset, &scenes)?;
    check_out(options)?;
    // Whether the dataset can be written is found before hours of rendering, and not after.
    drop(BuildFolder::of(&dataset.root).lease_of_verdict()?);
    let work = options.out.as_deref().map(WorkFolder::start).transpose()?;
    let mut file = CompareFile {
        format: COMPARE_FORMAT.to_owned(),
        tool: tool.to_owned(),
        dataset: dataset.file.named(),
        renderer: COMPARED.to_string(),
        bounds: BOUNDS,
        agrees: true,
        undecided: 0,
        scenes: Vec::new(),
    };
    for (at, scene) in scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, scenes.len()));
        let place = work.as_ref().map(WorkFolder::path);
        let (found, shown) = compare_scene(&dataset.folder(&scene.id), scene, options.samples, place, progress)?;
        if let Some(place) = place {
            page::write_scene(place, &file, &found, &shown)?;
        }
        file.scenes.push(found);
    }
    let states: Vec<State> = file.checks().map(|(_, _, check)| check.state).collect();
    file.agrees = !states.iter().any(|state| state.is_fault());
    file.undecided = states.iter().filter(|state| state.is_open()).count();
    if !file.scenes.is_empty() {
        verdict(&file).add_beside(&dataset.root)?;
    }
    if let Some(work) = work {
        json::write(&work.path().join(COMPARE), &file)?;
        mateval_files::whole::write_whole(&work.path().join("index.html"), page::index(&file).as_bytes())?;
        work.finish()?;
    }
    Ok(file)
}

/// The outcomes by scene, as the dataset's `compare.json` holds them.
fn verdict(file: &CompareFile) -> VerdictFile {
    let mut scenes: BTreeMap<SceneId, CompareCounts> = BTreeMap::new();
    for (scene, _, check) in file.checks() {
        let counts = scenes.entry(scene.clone()).or_default();
        match check.state {
            State::Agrees => counts.agree += 1,
            State::Differs | State::Missing | State::Unreadable => counts.differ += 1,
            State::TooNoisy | State::TooFew | State::Undecided => counts.undecided += 1,
        }
    }
    VerdictFile {
        format: VERDICT_FORMAT.to_owned(),
        tool: file.tool.clone(),
        manifest_sha256: file.dataset.manifest_sha256.clone(),
        scenes,
    }
}

/// The renderer whose pictures are compared with the built-in tracer's.
const COMPARED: RendererKind = RendererKind::Blender;

/// The folder of Blender's pictures of the view; absent if they are missing or incomplete.
fn rendered(folder: &SceneFolder, view: &View) -> Option<PathBuf> {
    let place = folder.render(&COMPARED.id(), &view.id);
    place.join(RENDER_FILE).is_file().then_some(place)
}

/// Fails where there are scenes and Blender has rendered no view of any.
fn check_rendered(dataset: &Dataset, scenes: &[&SceneFile]) -> Result<(), PrepError> {
    let has_any =
        |scene: &&&SceneFile| scene.views.iter().any(|view| rendered(&dataset.folder(&scene.id), view).is_some());
    if scenes.is_empty() || scenes.iter().any(|scene| has_any(&scene)) {
        return Ok(());
    }
    let scenes = scenes.iter().map(|scene| scene.id.clone()).collect();
    Err(PrepError::NotRendered { path: dataset.root.clone(), renderer: COMPARED.id(), scenes })
}

/// Fails where the output would lie in the dataset, or exists and may not be replaced.
fn check_out(options: &CompareOptions) -> Result<(), PrepError> {
    let Some(out) = &options.out else { return Ok(()) };
    check_outside(out, &options.dataset, "--out")?;
    if !out.exists() {
        return Ok(());
    }
    check_free(out, options.force, "--out")?;
    match json::read_format::<CompareFile>(&out.join(COMPARE), COMPARE_FORMAT).is_ok() {
        true => Ok(()),
        false => {
            Err(PrepError::unusable(out, "exists and is not a comparison; it is not replaced: choose another --out"))
        }
    }
}

/// Compares the views of a scene that Blender has rendered, and writes their previews below `out`.
fn compare_scene(
    folder: &SceneFolder,
    scene: &SceneFile,
    sampling: Sampling,
    out: Option<&Path>,
    progress: Progress<'_>,
) -> Result<(SceneComparison, Vec<ViewPreviews>), PrepError> {
    let reference = Arc::new(reference::read(folder)?);
    let world = World::new(reference.clone())?;
    let kinds = MaterialKind::of_surfaces(&reference);
    let tile_bound = match kinds.iter().all(|kind| *kind == MaterialKind::Lambert) {
        true => BOUNDS.lambert_tile,
        false => BOUNDS.other_tile,
    };
    let mut pairs = Vec::new();
    for view in &scene.views {
        let Some(theirs) = rendered(folder, view).map(|folder| TheirView { folder, size: size(view) }) else {
            continue;
        };
        let their_samples = theirs.samples()?;
        pairs.push(ViewPair {
            folder,
            view,
            theirs,
            their_samples,
            reference: &reference,
            world: &world,
            kinds: &kinds,
            tile_bound,
        });
    }
    let ours = render_ours(&world, &scene.id, &pairs, sampling, progress)?;
    let (mut views, mut previews) = (Vec::new(), Vec::new());
    let step = format!("{} compare", scene.id);
    let mut compared = pairs.iter().zip(&ours.lights).peekable();
    for (at, view) in scene.views.iter().enumerate() {
        progress(Report::step(&step, at, scene.views.len()));
        let Some((pair, light)) = compared.next_if(|(pair, _)| pair.view.id == view.id) else {
            views.push(missing(view));
            continue;
        };
        let (found, shown) = pair.compare(light, ours.samples(), out.map(|out| (out, scene, previews.is_empty())))?;
        views.push(found);
        previews.extend(shown);
    }
    progress(Report::step(&step, scene.views.len(), scene.views.len()));
    let seeds = pictures::seeds(&scene.id, 0).map(|seed| format!("{seed:016x}"));
    let kinds = kinds.into_iter().collect::<std::collections::BTreeSet<_>>().into_iter().collect();
    let found =
        SceneComparison { scene: scene.id.clone(), kinds, tile_bound, passes: ours.passes().to_vec(), seeds, views };
    Ok((found, previews))
}

/// Renders the views with the built-in tracer, until the samples are those asked for, or more would decide no check.
fn render_ours(
    world: &World,
    id: &SceneId,
    pairs: &[ViewPair<'_>],
    sampling: Sampling,
    progress: Progress<'_>,
) -> Result<OurRender, PrepError> {
    let mut ours = OurRender::new();
    let Some(most_of_theirs) = pairs.iter().map(|pair| pair.their_samples).max() else { return Ok(ours) };
    let budget = match sampling {
        Sampling::Exactly(samples) | Sampling::AtMost(samples) => samples,
        Sampling::UntilDecided => BOUNDS.least_samples.max(most_of_theirs.saturating_mul(BUDGET_OVER_THEIRS)),
    };
    let first = match sampling {
        Sampling::Exactly(samples) => samples,
        _ => BOUNDS.least_samples.min(budget),
    };
    let views: Vec<&View> = pairs.iter().map(|pair| pair.view).collect();
    ours.add(world, id, &views, first, progress)?;
    while ours.samples() < budget {
        let mut wanted = None;
        for (pair, light) in pairs.iter().zip(&ours.lights) {
            wanted = wanted.max(pair.wanted_samples(light, ours.samples())?);
        }
        let Some(wanted) = wanted else { break };
        // At least half as many again, since the estimate is itself noisy, and every look at the checks costs.
        let done = ours.samples();
        let next = wanted.max(done.saturating_add(done.div_ceil(2))).min(budget);
        ours.add(world, id, &views, (next - done).min(MOST_SAMPLES), progress)?;
    }
    Ok(ours)
}

fn size(view: &View) -> (usize, usize) {
    (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize)
}

fn missing(view: &View) -> ViewComparison {
    let message = format!("the view was not rendered; run `mateval prep render DATASET --renderer {COMPARED}`");
    let checks = vec![file_check("render", State::Missing, message)];
    ViewComparison { view: view.id.clone(), checks, light: Vec::new() }
}

/// A view that both renderers have rendered.
struct ViewPair<'a> {
    folder: &'a SceneFolder,
    view: &'a View,
    theirs: TheirView,
    /// Samples per pixel of each half of Blender's.
    their_samples: u32,
    reference: &'a ReferenceScene,
    world: &'a World,
    kinds: &'a [MaterialKind],
    tile_bound: f64,
}

impl ViewPair<'_> {
    /// The dataset's own pictures of the view.
    fn geometry(&self) -> Result<OurGeometry, PrepError> {
        let ours = OurGeometry::read(self.folder, self.view, self.world)?;
        let (width, height) = self.theirs.size;
        match ours.has_size(self.theirs.size) {
            true => Ok(ours),
            false => Err(PrepError::ViewSize { path: self.folder.view(&self.view.id), expected: [width, height] }),
        }
    }

    /// The samples of each of our halves that would decide the most demanding check that more of ours would decide;
    /// absent if more would decide none. `samples` are those of `light`.
    fn wanted_samples(&self, light: &OurLight, samples: u32) -> Result<Option<u32>, PrepError> {
        let geometry = self.geometry()?;
        let shown = ShownKinds::new(&geometry.instance, self.kinds, &geometry.valid);
        let mut found = ViewComparison { view: self.view.id.clone(), checks: Vec::new(), light: Vec::new() };
        self.compare_lights(light, samples, &shown, &mut found);
        let needed = found.checks.iter().filter_map(|check| check.to_decide);
        Ok(needed.filter(|needed| needed.theirs <= self.their_samples).map(|needed| needed.ours).max())
    }

    fn compare(
        &self,
        light: &OurLight,
        samples: u32,
        out: Option<(&Path, &SceneFile, bool)>,
    ) -> Result<(ViewComparison, Option<ViewPreviews>), PrepError> {
        let ours = self.geometry()?;
        let theirs = &self.theirs;
        let mut found = ViewComparison { view: self.view.id.clone(), checks: Vec::new(), light: Vec::new() };
        let their_geometry = TheirGeometry::read(theirs, &mut found.checks);
        found.checks.extend(geometry::compare(&ours, &their_geometry));
        let shown = ShownKinds::new(&ours.instance, self.kinds, &ours.valid);
        let their_light = self.compare_lights(light, samples, &shown, &mut found);
        let Some((out, scene, whole)) = out else { return Ok((found, None)) };
        let mut previews = ViewPreviews::new(out, scene, &found, whole)?;
        let both = std::iter::once(&light.rgb).chain(&light.groups).zip(&their_light);
        let both = both.filter_map(|(ours, theirs)| theirs.as_ref().map(|theirs| [ours, theirs]));
        for (light, both) in found.light.iter().zip(both) {
            previews.add_light(light, both, &shown, self.tile_bound)?;
        }
        previews.add_geometry(&ours, &their_geometry)?;
        Ok((found, Some(previews)))
    }

    /// Compares RGB, each light group, and the sum of the groups. Returns Blender's pictures in this order; none for
    /// those that could not be read.
    fn compare_lights(
        &self,
        light: &OurLight,
        samples: u32,
        shown: &ShownKinds,
        found: &mut ViewComparison,
    ) -> Vec<Option<Halves>> {
        let samples = SamplesToDecide { ours: samples, theirs: self.their_samples };
        let mut all = vec![self.compare_light("rgb", None, &light.rgb, samples, shown, found)];
        for (at, (ours, group)) in light.groups.iter().zip(&self.reference.lights).enumerate() {
            let name = Some(group.name.clone());
            all.push(self.compare_light(&format!("group_{at:02}"), name, ours, samples, shown, found));
        }
        let read: Vec<&Halves> = all.iter().flatten().collect();
        if let Some((rgb, groups)) = read.split_first().filter(|_| read.len() == all.len()) {
            let sums = |half: fn(&Halves) -> &_| groups.iter().map(|group| half(group)).collect::<Vec<_>>();
            found.checks.push(light::sum_check("rgb_a", &rgb.a, &sums(|group| &group.a)));
            found.checks.push(light::sum_check("rgb_b", &rgb.b, &sums(|group| &group.b)));
        }
        all
    }

    /// Compares one picture of light. Returns Blender's picture; absent if it could not be read.
    fn compare_light(
        &self,
        picture: &str,
        name: Option<String>,
        ours: &Halves,
        samples: SamplesToDecide,
        shown: &ShownKinds,
        found: &mut ViewComparison,
    ) -> Option<Halves> {
        match self.theirs.halves(picture) {
            Ok(theirs) => {
                found.checks.extend(light::same_halves(picture, &theirs));
                let (light, checks): (LightComparison, _) =
                    light::compare(picture, name, [ours, &theirs], samples, shown, self.tile_bound);
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
