//! The RGB truth: every view rendered in two independent halves, by our own tracer or by Blender.

mod blender_scene;
mod builtin;
mod noise;
mod store;

use std::path::Path;
use std::time::Duration;

use mateval_scene::dataset::{DatasetFile, SceneFile, View};
use mateval_scene::layout::{DATASET, INPUT, MANIFEST, SceneFolder};
use mateval_scene::manifest::{self, sha256_of_bytes};
use mateval_scene::open::chosen_ids;
use mateval_scene::{Finding, Progress, RendererId, SceneError, SceneId, json};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::blender::{BlenderLimits, BlenderProgram};
use crate::build::RECIPE;
use crate::error::PrepError;
use crate::recipe;
pub use noise::RenderNoise;

/// The name that our own tracer's renders are kept under.
pub const BUILTIN: &str = "builtin";
/// The name that Blender's renders are kept under.
pub const BLENDER: &str = "blender";
/// Scatterings after the first hit after which a path is cut.
pub const MAX_BOUNCES: u32 = 16;

/// What to render.
#[derive(Clone, Debug, Default)]
pub struct RenderOptions {
    /// By what.
    pub renderer: Renderer,
    /// Samples a pixel of each half; the recipe's where absent.
    pub samples: Option<u32>,
    /// Only these scenes; all where empty.
    pub scenes: Vec<SceneId>,
    /// Render again what is there.
    pub force: bool,
}

/// What renders.
#[derive(Clone, Debug, Default)]
pub enum Renderer {
    /// Our own path tracer.
    #[default]
    Builtin,
    /// Blender's Cycles.
    Blender(BlenderOptions),
}

/// How Blender is run.
#[derive(Clone, Debug)]
pub struct BlenderOptions {
    /// What is run.
    pub program: BlenderProgram,
    /// What a run may take.
    pub limits: BlenderLimits,
    /// Scenes rendered at once.
    pub jobs: usize,
    /// How often a scene is tried.
    pub attempts: u32,
}

impl BlenderOptions {
    /// One scene at a time, tried twice, in two hours and 16 GiB at most.
    pub fn new(program: BlenderProgram) -> Self {
        let limits = BlenderLimits {
            time: Duration::from_secs(2 * 3600),
            silence: Duration::from_secs(15 * 60),
            memory_bytes: 16 << 30,
        };
        Self { program, limits, jobs: 1, attempts: 2 }
    }
}

impl Renderer {
    fn id(&self) -> RendererId {
        let name = match self {
            Self::Builtin => BUILTIN,
            Self::Blender(_) => BLENDER,
        };
        RendererId::new(name).expect("our own ids are ids")
    }
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct RenderReport {
    /// Views rendered.
    pub rendered: usize,
    /// Views that an earlier run had rendered.
    pub kept: usize,
    /// What a user should know, a line each.
    pub remarks: Vec<String>,
    /// Scenes that could not be rendered, and why; the others were.
    pub failures: Vec<Finding>,
}

/// `render.json` beside a view's pictures: how they were made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderFile {
    /// `builtin` or `blender`.
    pub renderer: String,
    /// The renderer's own version; null for ours, which is that of the dataset's tool.
    pub renderer_version: Option<String>,
    /// Samples a pixel of each of the two halves.
    pub samples_each_half: u32,
    /// Seeds of `rgb_a` and `rgb_b`, 16 hexadecimal digits each.
    pub seeds: [String; 2],
    /// Scatterings after which a path is cut.
    pub max_bounces: u32,
    /// What cut paths still carried, averaged over all: times the radiance there, the light that is missing. Null
    /// where the renderer does not tell.
    pub capped_throughput: Option<f64>,
    /// What took the noise out of `rgb`; null where that is the plain mean of the halves.
    pub denoiser: Option<String>,
    /// How noisy the pictures are.
    pub noise: RenderNoise,
    /// What the renderer shows only nearly as the source means it, a line a material.
    pub approximations: Vec<String>,
}

/// Renders, then names the scored renderer and renews the manifest. Views that are there with the same settings are
/// kept, so that a killed run goes on; a scene that Blender cannot render is a failure in the report, and the others go on.
pub fn render(root: &Path, options: &RenderOptions, progress: Progress<'_>) -> Result<RenderReport, PrepError> {
    let mut dataset: DatasetFile = json::read(&root.join(DATASET))?;
    if !root.join(MANIFEST).is_file() {
        let what = "holds no MANIFEST.sha256: an unfinished `prep build`; run that again".to_owned();
        return Err(PrepError::Output { path: root.to_owned(), what });
    }
    let wanted = chosen_ids(root, &dataset, &options.scenes)?;
    let renderer = options.renderer.id();
    check_hashes(root, &renderer)?;
    let samples = match options.samples {
        Some(samples) => samples,
        None => recipe::read(&root.join(RECIPE))?.0.samples,
    };
    let order = Order { root, samples, force: options.force };
    let mut report = match &options.renderer {
        Renderer::Builtin => builtin::render_scenes(&order, &wanted, progress)?,
        Renderer::Blender(blender) => blender_scene::render_scenes(&order, blender, &wanted, progress)?,
    };
    dataset.scored_renderer = scored_renderer(root, &dataset);
    if dataset.scored_renderer.is_none() {
        report.remarks.push("some scenes have no pictures yet: the dataset names no scored renderer".to_owned());
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

/// What every scene is rendered with.
struct Order<'a> {
    root: &'a Path,
    samples: u32,
    force: bool,
}

impl Order<'_> {
    /// Whether the view's pictures are there and were made so.
    fn is_done(&self, folder: &SceneFolder, view: &View, renderer: &RendererId, seeds: &[String; 2]) -> bool {
        let mark = folder.render(renderer, &view.id).join(store::MARK);
        let is_same = |found: RenderFile| {
            (found.samples_each_half, &found.seeds, found.max_bounces) == (self.samples, seeds, MAX_BOUNCES)
        };
        !self.force && json::read::<RenderFile>(&mark).is_ok_and(is_same)
    }
}

/// Everything that is no render of this renderer must be what the manifest says: it is about to be renewed.
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

/// Blender where it has rendered every view, else our own tracer where that has.
fn scored_renderer(root: &Path, dataset: &DatasetFile) -> Option<RendererId> {
    let known = [BLENDER, BUILTIN].map(|name| RendererId::new(name).expect("our own ids are ids"));
    known.into_iter().find(|renderer| dataset.scenes.iter().all(|id| is_complete(root, id, renderer)))
}

fn is_complete(root: &Path, id: &SceneId, renderer: &RendererId) -> bool {
    let folder = SceneFolder::of(root, id);
    json::read::<SceneFile>(&folder.scene_file())
        .is_ok_and(|scene| scene.views.iter().all(|view| folder.render(renderer, &view.id).join(store::MARK).is_file()))
}

/// The two halves of a picture must not share a sequence: their errors would be correlated.
fn seed(scene: &SceneId, view: &View, half: usize) -> u64 {
    let text = sha256_of_bytes(format!("{scene}/{}/{half}", view.id).as_bytes());
    u64::from_str_radix(&text[..16], 16).expect("a hash is hexadecimal")
}

/// Seeds as `render.json` tells them.
fn seed_texts(seeds: [u64; 2]) -> [String; 2] {
    seeds.map(|seed| format!("{seed:016x}"))
}
