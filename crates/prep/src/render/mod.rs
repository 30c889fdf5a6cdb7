//! The RGB ground truth: every view rendered in two independent halves.
//!
//! In: a built dataset. Out: pictures in `ground_truth/renders/<renderer>/`, the scored renderer's name in `dataset.json`,
//! its picture of the input view as the photo that methods see, and a new manifest.
//!
//! A new renderer is a file beside `builtin.rs`, a variant of [`RendererKind`] and of [`Renderer`], and its arguments in
//! the command line's `prep render`.

mod blender_scene;
mod builtin;
mod kind;
mod noise;
mod render_file;
mod render_run;
mod report;
mod store;

use std::path::Path;

use mateval_scene::dataset::{DatasetFile, SceneFile};
use mateval_scene::layout::{DATASET, INPUT, MANIFEST, SceneFolder};
use mateval_scene::open::chosen_ids;
use mateval_scene::{Progress, RendererId, SceneError, SceneId, json, manifest};

pub use crate::blender::{BlenderLimits, BlenderProgram};
use crate::build::RECIPE;
use crate::error::PrepError;
use crate::recipe;
pub use blender_scene::BlenderOptions;
pub use kind::{RendererKind, UnknownRenderer};
pub use noise::RenderNoise;
pub use render_file::{RENDER_FILE, RenderFile};
pub use render_run::MAX_BOUNCES;
use render_run::RenderRun;
pub use report::RenderReport;

/// What to render.
#[derive(Clone, Debug, Default)]
pub struct RenderOptions {
    /// The renderer and its options.
    pub renderer: Renderer,
    /// Samples per pixel of each half; the recipe's number where absent.
    pub samples: Option<u32>,
    /// Only these scenes; all where empty.
    pub scenes: Vec<SceneId>,
    /// Render pictures again that already exist.
    pub force: bool,
}

/// A renderer with its options.
#[derive(Clone, Debug, Default)]
pub enum Renderer {
    /// MatEval's own path tracer.
    #[default]
    Builtin,
    /// Blender's Cycles.
    Blender(BlenderOptions),
}

impl Renderer {
    /// Which renderer it is.
    pub fn kind(&self) -> RendererKind {
        match self {
            Self::Builtin => RendererKind::Builtin,
            Self::Blender(_) => RendererKind::Blender,
        }
    }

    fn render_scenes(
        &self,
        run: &RenderRun<'_>,
        scenes: &[&SceneId],
        progress: Progress<'_>,
    ) -> Result<RenderReport, PrepError> {
        match self {
            Self::Builtin => builtin::render_scenes(run, scenes, progress),
            Self::Blender(options) => blender_scene::render_scenes(run, options, scenes, progress),
        }
    }
}

/// Renders the dataset in `root`, then names the scored renderer and writes a new manifest.
///
/// Views that exist with the same settings are kept, so that a killed run resumes where it ended. A scene that Blender
/// cannot render becomes a failure in the report; the others are still rendered.
pub fn render(root: &Path, options: &RenderOptions, progress: Progress<'_>) -> Result<RenderReport, PrepError> {
    let mut dataset: DatasetFile = json::read(&root.join(DATASET))?;
    if !root.join(MANIFEST).is_file() {
        return Err(PrepError::UnfinishedBuild { path: root.to_owned() });
    }
    let wanted = chosen_ids(root, &dataset, &options.scenes)?;
    let renderer = options.renderer.kind().id();
    check_hashes(root, &renderer)?;
    let samples = match options.samples {
        Some(samples) => samples,
        None => recipe::read(&root.join(RECIPE))?.0.samples,
    };
    let run = RenderRun { root, renderer: renderer.clone(), samples, force: options.force };
    let mut report = options.renderer.render_scenes(&run, &wanted, progress)?;
    dataset.scored_renderer = scored_renderer(root, &dataset);
    if dataset.scored_renderer.is_none() {
        report.remarks.push("some scenes have no pictures yet, so the dataset names no scored renderer".to_owned());
    }
    let shown = dataset.scored_renderer.clone().unwrap_or(renderer);
    for id in &dataset.scenes {
        store::show_input(&SceneFolder::of(root, id), &shown)?;
    }
    progress("hashes", 0, 1);
    dataset.manifest_sha256 = manifest::write(root)?;
    json::write(&root.join(DATASET), &dataset)?;
    Ok(report)
}

/// Checks every file but this renderer's pictures against the manifest, which is about to be replaced.
fn check_hashes(root: &Path, renderer: &RendererId) -> Result<(), PrepError> {
    let ours = format!("/ground_truth/renders/{renderer}/");
    let shown = format!("/views/{INPUT}/rgb.");
    let is_ours = |path: &str| path.contains(&ours) || path.contains(&shown) || path.ends_with(".partial");
    let findings = manifest::check_those(root, |path| !is_ours(path))?;
    if findings.is_empty() {
        return Ok(());
    }
    Err(SceneError::Invalid { path: root.to_owned(), findings }.into())
}

/// The first renderer in the order of [`RendererKind::ALL`] that has rendered every view; none where none has.
fn scored_renderer(root: &Path, dataset: &DatasetFile) -> Option<RendererId> {
    let mut known = RendererKind::ALL.map(RendererKind::id).into_iter();
    known.find(|renderer| dataset.scenes.iter().all(|id| is_complete(root, id, renderer)))
}

fn is_complete(root: &Path, id: &SceneId, renderer: &RendererId) -> bool {
    let folder = SceneFolder::of(root, id);
    json::read::<SceneFile>(&folder.scene_file())
        .is_ok_and(|scene| scene.views.iter().all(|view| folder.render(renderer, &view.id).join(RENDER_FILE).is_file()))
}
