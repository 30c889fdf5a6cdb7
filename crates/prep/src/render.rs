//! The RGB truth: every view rendered in two independent halves.

use std::path::Path;
use std::sync::Arc;

use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::dataset::{DatasetFile, SceneFile, View};
use mateval_scene::layout::{DATASET, INPUT, MANIFEST, SceneFolder};
use mateval_scene::manifest::{self, sha256_of_bytes};
use mateval_scene::{RendererId, SceneError, SceneId, json, reference_io};
use mateval_tracer::{Render, RenderSettings, RenderStats, World};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::build::RECIPE;
use crate::error::PrepError;
use crate::recipe;
use mateval_scene::Progress;

/// The name that its renders are kept under.
pub const BUILTIN: &str = "builtin";

/// What to render.
#[derive(Clone, Debug, Default)]
pub struct RenderOptions {
    /// Samples a pixel of each half; the recipe's where absent.
    pub samples: Option<u32>,
    /// Only these scenes; all where empty.
    pub scenes: Vec<SceneId>,
    /// Render again what is there.
    pub force: bool,
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
}

/// `render.json` beside a view's pictures: how they were made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderFile {
    /// `builtin`.
    pub renderer: String,
    /// Samples a pixel of each of the two halves.
    pub samples_each_half: u32,
    /// Seeds of `rgb_a` and `rgb_b`, 16 hexadecimal digits each.
    pub seeds: [String; 2],
    /// Scatterings after which a path is cut.
    pub max_bounces: u32,
    /// What cut paths still carried, averaged over all: times the radiance there, the light that is missing.
    pub capped_throughput: f64,
}

/// Renders with our own tracer, then makes its pictures the scored ones and renews the manifest. Views that are there with
/// the same settings are kept, so that a killed run goes on.
pub fn render(root: &Path, options: &RenderOptions, progress: Progress<'_>) -> Result<RenderReport, PrepError> {
    let mut dataset: DatasetFile = json::read(&root.join(DATASET))?;
    check_scenes(root, &dataset, options)?;
    check_hashes(root)?;
    let samples = match options.samples {
        Some(samples) => samples,
        None => recipe::read(&root.join(RECIPE))?.0.samples,
    };
    let mut report = RenderReport::default();
    for id in dataset.scenes.iter().filter(|id| options.scenes.is_empty() || options.scenes.contains(id)) {
        render_scene(root, id, samples, options.force, progress, &mut report)?;
    }
    let complete = dataset.scenes.iter().all(|id| is_complete(root, id));
    if complete {
        dataset.scored_renderer = Some(builtin());
    } else {
        report.remarks.push("some scenes have no pictures yet: the dataset names no scored renderer".to_owned());
    }
    progress("hashes", 0, 1);
    dataset.manifest_sha256 = manifest::write(root)?;
    json::write(&root.join(DATASET), &dataset)?;
    Ok(report)
}

fn check_scenes(root: &Path, dataset: &DatasetFile, options: &RenderOptions) -> Result<(), PrepError> {
    let unknown: Vec<&str> =
        options.scenes.iter().filter(|id| !dataset.scenes.contains(id)).map(SceneId::as_str).collect();
    if !root.join(MANIFEST).is_file() || !unknown.is_empty() {
        let what = match unknown.as_slice() {
            [] => "holds no MANIFEST.sha256: an unfinished `prep build`; run that again".to_owned(),
            names => format!("has no scene '{}'", names.join("', '")),
        };
        return Err(PrepError::Output { path: root.to_owned(), what });
    }
    Ok(())
}

/// Everything that is no render of ours must be what the manifest says: it is about to be renewed.
fn check_hashes(root: &Path) -> Result<(), PrepError> {
    let ours = format!("/ground_truth/renders/{BUILTIN}/");
    let shown = format!("/views/{INPUT}/rgb.");
    let is_ours = |path: &str| path.contains(&ours) || path.contains(&shown) || path.ends_with(".partial");
    let findings = manifest::check_those(root, |path| !is_ours(path))?;
    if findings.is_empty() {
        return Ok(());
    }
    Err(SceneError::Invalid { path: root.to_owned(), findings }.into())
}

fn builtin() -> RendererId {
    RendererId::new(BUILTIN).expect("our own id is an id")
}

fn is_complete(root: &Path, id: &SceneId) -> bool {
    let folder = SceneFolder::of(root, id);
    json::read::<SceneFile>(&folder.scene_file()).is_ok_and(|scene| {
        scene.views.iter().all(|view| folder.render(&builtin(), &view.id).join("render.json").is_file())
    })
}

fn render_scene(
    root: &Path,
    id: &SceneId,
    samples: u32,
    force: bool,
    progress: Progress<'_>,
    report: &mut RenderReport,
) -> Result<(), PrepError> {
    let folder = SceneFolder::of(root, id);
    let scene: SceneFile = json::read(&folder.scene_file())?;
    let mut world: Option<World> = None;
    for view in &scene.views {
        let place = folder.render(&builtin(), &view.id);
        let settings = [0, 1].map(|half| RenderSettings { samples, seed: seed(id, view, half), ..Default::default() });
        let seeds = [0, 1].map(|half: usize| format!("{:016x}", settings[half].seed));
        let max_bounces = settings[0].max_bounces;
        let is_same = |found: &RenderFile| {
            (found.samples_each_half, &found.seeds, found.max_bounces) == (samples, &seeds, max_bounces)
        };
        let file = |a: &Render, b: &Render| RenderFile {
            renderer: BUILTIN.to_owned(),
            samples_each_half: samples,
            seeds: seeds.clone(),
            max_bounces,
            capped_throughput: (a.stats.capped_throughput + b.stats.capped_throughput) / 2.0,
        };
        if !force && json::read::<RenderFile>(&place.join("render.json")).is_ok_and(|found| is_same(&found)) {
            report.kept += 1;
            continue;
        }
        let world = match &mut world {
            Some(world) => world,
            none => none.insert(World::new(Arc::new(reference_io::read(&folder)?))?),
        };
        let step = format!("{id} {}", view.id);
        let half = |half: usize| {
            let shown = |done: usize, all: usize| progress(&step, half * all + done, 2 * all);
            mateval_tracer::render(world, &view.camera, &settings[half], &shown)
        };
        let (a, b) = (half(0)?, half(1)?);
        write_view(&folder, view, scene.exposure, [&a, &b], file(&a, &b))?;
        report.remarks.extend(remark(&step, &a.stats).into_iter().chain(remark(&step, &b.stats)));
        report.rendered += 1;
    }
    Ok(())
}

/// The two halves of a picture must not share a sequence: their errors would be correlated.
fn seed(scene: &SceneId, view: &View, half: usize) -> u64 {
    let text = sha256_of_bytes(format!("{scene}/{}/{half}", view.id).as_bytes());
    u64::from_str_radix(&text[..16], 16).expect("a hash is hexadecimal")
}

fn remark(step: &str, stats: &RenderStats) -> Option<String> {
    (stats.not_finite > 0).then(|| format!("{step}: {} samples were not finite and left out: a bug", stats.not_finite))
}

fn write_view(
    folder: &SceneFolder,
    view: &View,
    exposure: f64,
    [a, b]: [&Render; 2],
    file: RenderFile,
) -> Result<(), PrepError> {
    let place = folder.render(&builtin(), &view.id);
    std::fs::create_dir_all(&place).map_err(PrepError::io("make", &place))?;
    // First: it must not vouch for pictures that are half replaced.
    let mark = place.join("render.json");
    if mark.exists() {
        std::fs::remove_file(&mark).map_err(PrepError::io("remove", &mark))?;
    }
    let (a, b) = (&a.picture, &b.picture);
    let mean = mean(a, b);
    exr_io::write_linear(&place.join("rgb_a.exr"), a, Precision::Float)?;
    exr_io::write_linear(&place.join("rgb_b.exr"), b, Precision::Float)?;
    exr_io::write_linear(&place.join("rgb.exr"), &mean, Precision::Float)?;
    let preview = mean.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (f64::from(v) * exposure) as f32))).to_srgb();
    png_io::write_srgb(&place.join("rgb.png"), &preview)?;
    if view.id.as_str() == INPUT {
        let shown = folder.view(&view.id);
        exr_io::write_linear(&shown.join("rgb.exr"), &mean, Precision::Float)?;
        png_io::write_srgb(&shown.join("rgb.png"), &preview)?;
    }
    // Last: it says that the others are whole.
    Ok(json::write(&mark, &file)?)
}

fn mean(a: &Picture<LinearRgb>, b: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    let pixels = a.pixels().iter().zip(b.pixels());
    let pixels = pixels.map(|(a, b)| LinearRgb(std::array::from_fn(|c| (a.0[c] + b.0[c]) / 2.0))).collect();
    Picture::new(a.width(), a.height(), pixels).expect("both halves are of one size")
}
