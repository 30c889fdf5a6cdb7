//! The RGB ground truth: every view of every scene without a photo, rendered in two independent halves.
//!
//! In: a built dataset. Out: pictures in `ground_truth/renders/<renderer>/`, the photo renderer's name in `dataset.json`,
//! its picture of the input view as the photo that methods see, and a new manifest (of chosen scenes, `finish` writes them).
//!
//! A new renderer is a file beside `builtin.rs`, a variant of [`RendererKind`] and of [`Renderer`], and its arguments in
//! the command line's `prep render`.

mod blender_scene;
mod builtin;
pub(crate) mod kind;
mod render_run;
mod report;
pub(crate) mod store;

use std::path::Path;

use mateval_scene::build_folder::BuildFolder;
use mateval_scene::dataset::{DatasetFile, FORMAT, SceneFile};
use mateval_scene::layout::{DATASET, MANIFEST, SceneFolder};
use mateval_scene::open::chosen_ids;
use mateval_scene::{Progress, SceneId, json};

pub use crate::blender::{BlenderLimits, BlenderProgram};
use crate::build::start::is_build;
use crate::error::PrepError;
use crate::finish::{check_strays, finish_again};
use crate::recipe::{self, RECIPE};
pub use blender_scene::BlenderOptions;
pub use kind::{RendererKind, UnknownRenderer};
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
            Self::Builtin => builtin::render_scenes(run, scenes, progress),
            Self::Blender(options) => blender_scene::render_scenes(run, options, scenes, progress),
        }
    }
}

/// Renders the dataset in `root`. Where no scenes are chosen, it then names the photo renderer and writes a new manifest;
/// otherwise [`crate::finish`] does so, and several processes may render different scenes at once.
///
/// Views that exist with the same settings are kept, so that a killed run resumes where it ended. A scene that Blender
/// cannot render becomes a failure in the report; the others are still rendered. Scenes with a photo from elsewhere are not
/// rendered, and a remark names each.
pub fn render(root: &Path, options: &RenderOptions, progress: Progress<'_>) -> Result<RenderReport, PrepError> {
    let build_recipe = is_build(root).then(|| BuildFolder::of(root).recipe());
    if build_recipe.is_some() && !root.join(DATASET).is_file() {
        return Err(PrepError::UnfinishedBuild { path: root.to_owned() });
    }
    let dataset: DatasetFile = json::read_format(&root.join(DATASET), FORMAT)?;
    if !root.join(MANIFEST).is_file() {
        return Err(PrepError::UnfinishedBuild { path: root.to_owned() });
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

/// Those of the scenes that are rendered, then those that have a photo from elsewhere.
fn without_photos<'a>(
    root: &Path,
    scenes: Vec<&'a SceneId>,
) -> Result<(Vec<&'a SceneId>, Vec<&'a SceneId>), PrepError> {
    let (mut rendered, mut photographed) = (Vec::new(), Vec::new());
    for id in scenes {
        let scene: SceneFile = json::read(&SceneFolder::of(root, id).scene_file())?;
        if scene.photo.is_some() { photographed.push(id) } else { rendered.push(id) }
    }
    Ok((rendered, photographed))
}
