//! The RGB ground truth: every view of every scene without a photo, rendered in two independent halves.
//!
//! In: a built dataset. Out: pictures in `ground_truth/renders/<renderer>/`, the photo renderer's name in
//! `dataset.json`, its picture of the input view as the photo that methods see, and a new manifest (of chosen scenes,
//! `finish` writes them).
//!
//! `run` holds what all renderers share. MatEval's own path tracer renders here, `blender` has Blender render. A new
//! renderer is a file beside `blender.rs`, a variant of [`RendererKind`] and of [`Renderer`], and its arguments in the
//! command line's `prep render`.

mod blender;
pub(crate) mod run;

use std::path::Path;
use std::sync::Arc;

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::{BuildFolder, DATASET, MANIFEST, SceneFolder};
use mateval_dataset::open::{chosen_ids, read_dataset_file};
use mateval_dataset::render_file::{RENDER_FILE, RenderFile, RenderNoise};
use mateval_dataset::{Progress, RendererId, Report, SceneId, json, reference};
use mateval_image::{exr_io, png_io};
use mateval_tracer::noise_filter::{self, Surfaces, filtered_mean};
use mateval_tracer::{LightBasis, RenderSettings, RenderStats, World, render_views};

use crate::blender_job::LightPictures;
pub use crate::blender_job::{BlenderLimits, BlenderProgram, DeviceChoice};
use crate::build::finish::{check_strays, finish_again};
use crate::build::start::is_build;
use crate::error::PrepError;
use crate::recipe::{self, RECIPE};
use crate::views::map_of;
pub use blender::BlenderOptions;
pub use run::{MAX_BOUNCES, RenderReport, RendererKind};
use run::{RenderRun, ViewRender, seed, seed_texts, write_view};

#[derive(Clone, Debug, Default)]
pub struct RenderOptions {
    pub renderer: Renderer,
    /// Samples per pixel of each half; the recipe's number where absent.
    pub samples: Option<u32>,
    /// Only these scenes; all where empty.
    pub scenes: Vec<SceneId>,
    /// Render pictures again that already exist.
    pub force: bool,
}

#[derive(Clone, Debug, Default)]
pub enum Renderer {
    /// MatEval's own path tracer.
    #[default]
    Builtin,
    /// Blender's Cycles.
    Blender(BlenderOptions),
}

impl Renderer {
    pub fn kind(&self) -> RendererKind {
        match self {
            Self::Builtin => RendererKind::Builtin,
            Self::Blender(_) => RendererKind::Blender,
        }
    }

    /// The number of scenes that one process renders at once.
    fn scenes_at_once(&self) -> usize {
        match self {
            Self::Builtin => 1,
            Self::Blender(options) => options.jobs.max(1),
        }
    }

    fn render_scenes(
        &self,
        run: &RenderRun<'_>,
        scenes: &[&SceneId],
        progress: Progress<'_>,
    ) -> Result<RenderReport, PrepError> {
        match self {
            Self::Builtin => render_builtin(run, scenes, progress),
            Self::Blender(options) => blender::render_scenes(run, options, scenes, progress),
        }
    }
}

const UNFINISHED: &str = "lacks MANIFEST.sha256 or dataset.json: its build did not finish; run `prep build` again, or \
         `prep finish` where all scenes are made";

/// Renders the dataset in `root`. Where no scenes are chosen, it then names the photo renderer and writes a new
/// manifest; otherwise [`crate::build::finish`] does so, and several processes may render different scenes at once.
///
/// Views that exist with the same settings are kept, so that a killed run resumes where it ended. A scene that Blender
/// cannot render becomes a failure in the report; the others are still rendered. Scenes with a photo from elsewhere are
/// not rendered, and a remark names each.
pub fn render(root: &Path, options: &RenderOptions, progress: Progress<'_>) -> Result<RenderReport, PrepError> {
    let build_recipe = is_build(root).then(|| BuildFolder::of(root).recipe());
    if build_recipe.is_some() && !root.join(DATASET).is_file() {
        return Err(PrepError::unusable(root, UNFINISHED));
    }
    let dataset = read_dataset_file(root)?;
    if !root.join(MANIFEST).is_file() {
        return Err(PrepError::unusable(root, UNFINISHED));
    }
    if options.scenes.is_empty() {
        // `finish_again` would find them when all is rendered.
        check_strays(root, &dataset.scenes)?;
    }
    let wanted = chosen_ids(root, &dataset, &options.scenes)?;
    let (wanted, photographed) = without_photos(root, wanted)?;
    let renderer = options.renderer.kind().id();
    let samples = match options.samples {
        Some(samples) => samples,
        // The one that `finish` will put in the dataset.
        None => recipe::read(&build_recipe.unwrap_or(root.join(RECIPE)))?.0.samples,
    };
    let one_at_a_time = options.renderer.scenes_at_once() == 1;
    if !options.force {
        check_samples(root, &wanted, &renderer, samples)?;
    }
    let run = RenderRun { root, renderer, samples, force: options.force, one_at_a_time };
    let mut report = match wanted.is_empty() {
        true => RenderReport::default(),
        false => options.renderer.render_scenes(&run, &wanted, progress)?,
    };
    report.remarks.extend(photographed.into_iter().map(|id| {
        format!("{id}: not rendered, since its input picture is a photo from elsewhere, whose light is not known")
    }));
    if options.scenes.is_empty() {
        let dataset = finish_again(root, progress)?;
        if dataset.photo_renderer.is_none() && !wanted.is_empty() {
            let what = "some scenes have no pictures yet, so the dataset names no photo renderer";
            report.remarks.push(what.to_owned());
        }
    }
    Ok(report)
}

/// Fails where views were rendered with another number of samples: hours of work are not replaced unasked.
fn check_samples(root: &Path, scenes: &[&SceneId], renderer: &RendererId, wanted: u32) -> Result<(), PrepError> {
    let mut others: Vec<u32> = Vec::new();
    for id in scenes {
        let folder = SceneFolder::of(root, id);
        let scene = SceneFile::read(&folder)?;
        let rendered = scene.views.iter().map(|view| folder.render(renderer, &view.id).join(RENDER_FILE));
        let samples = rendered.filter_map(|path| Some(json::read::<RenderFile>(&path).ok()?.samples_each_half));
        others.extend(samples.filter(|samples| *samples != wanted));
    }
    match others.first() {
        None => Ok(()),
        Some(&found) => Err(PrepError::OtherSamples { path: root.to_owned(), views: others.len(), found, wanted }),
    }
}

/// Those of the scenes that are rendered, then those that have a photo from elsewhere.
fn without_photos<'a>(
    root: &Path,
    scenes: Vec<&'a SceneId>,
) -> Result<(Vec<&'a SceneId>, Vec<&'a SceneId>), PrepError> {
    let (mut rendered, mut photographed) = (Vec::new(), Vec::new());
    for id in scenes {
        let scene = SceneFile::read(&SceneFolder::of(root, id))?;
        if scene.photo.is_some() { photographed.push(id) } else { rendered.push(id) }
    }
    Ok((rendered, photographed))
}

/// Renders with MatEval's own path tracer the views that no earlier run has rendered, scene by scene.
fn render_builtin(run: &RenderRun<'_>, scenes: &[&SceneId], progress: Progress<'_>) -> Result<RenderReport, PrepError> {
    let mut report = RenderReport::default();
    for (at, id) in scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {id}"), at, scenes.len()));
        run.on_scene(id, || render_scene(run, id, progress, &mut report))?;
    }
    Ok(report)
}

fn render_scene(
    run: &RenderRun<'_>,
    id: &SceneId,
    progress: Progress<'_>,
    report: &mut RenderReport,
) -> Result<(), PrepError> {
    let folder = SceneFolder::of(run.root, id);
    let scene = SceneFile::read(&folder)?;
    let mut world: Option<World> = None;
    for view in &scene.views {
        let seeds = [0, 1].map(|half| seed(id, view, half));
        if run.done(&folder, view, &seed_texts(seeds)).is_some() {
            report.kept += 1;
            continue;
        }
        let world = match &mut world {
            Some(world) => world,
            none => none.insert(World::new(Arc::new(reference::read(&folder)?))?),
        };
        let step = format!("view {}", view.id);
        let shown = |done: usize, all: usize| progress(Report::step(&step, done, all));
        let settings = RenderSettings { samples: run.samples, max_bounces: MAX_BOUNCES, ..Default::default() };
        let mut render = render_views(world, &[view.camera], &settings, &seeds, &shown)?;
        let [a, b]: [LightPictures; 2] = std::array::from_fn(|_| light_pictures(render.views[0].by_seed.remove(0)));
        let shown = without_noise(&folder, view, [&a, &b])?;
        report.remarks.extend(remark(&format!("{id} {}", view.id), &render.stats));
        let file = RenderFile {
            renderer: run.renderer.clone(),
            renderer_version: None,
            device: None,
            samples_each_half: run.samples,
            seeds: seed_texts(seeds),
            max_bounces: MAX_BOUNCES,
            capped_throughput: Some(render.stats.capped_throughput),
            denoiser: noise_filter::NAME.to_owned(),
            noise: RenderNoise::of([&a.rgb, &b.rgb], &shown.rgb),
            approximations: Vec::new(),
        };
        let render = ViewRender { halves: [&a, &b], shown: &shown, passes: None };
        write_view(&folder.render(&run.renderer, &view.id), &render, scene.exposure, &file)?;
        report.rendered += 1;
    }
    Ok(())
}

fn remark(step: &str, stats: &RenderStats) -> Option<String> {
    (stats.not_finite > 0)
        .then(|| format!("{step}: left out {} samples that were not finite; please report this bug", stats.not_finite))
}

fn light_pictures(basis: LightBasis) -> LightPictures {
    LightPictures { rgb: basis.sum(), groups: basis.pictures().to_vec() }
}

/// The means of both halves, filtered on the surfaces that the view's maps show.
fn without_noise(folder: &SceneFolder, view: &View, [a, b]: [&LightPictures; 2]) -> Result<LightPictures, PrepError> {
    let (shown, hidden) = (folder.view(&view.id), folder.truth_view(&view.id));
    let base_color = map_of(view, &hidden.join("albedo.exr"), exr_io::read_linear)?;
    let instances = map_of(view, &shown.join("instance.png"), png_io::read_ids)?;
    let normals = map_of(view, &shown.join("normal.exr"), exr_io::read_normal)?;
    let valid = instances.map(|instance| instance != 0);
    let surfaces = Surfaces { base_color: Some(&base_color), instances: &instances, normals: &normals, valid: &valid };
    Ok(LightPictures {
        rgb: filtered_mean([&a.rgb, &b.rgb], &surfaces),
        groups: a.groups.iter().zip(&b.groups).map(|(a, b)| filtered_mean([a, b], &surfaces)).collect(),
    })
}
