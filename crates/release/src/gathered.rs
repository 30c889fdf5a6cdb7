//! What a release's report gathers from the dataset.
//!
//! This is how the RGB truth was rendered and how noisy it is, small pictures of the input views (for which only files
//! outside of `ground_truth` are read), the hashes of the inputs and their licences, the commands that make the release
//! again, and the paper's Table I with a column for the release.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_audit::stats::StatsFile;
use mateval_dataset::dataset::{DatasetFile, SceneFile, Target};
use mateval_dataset::layout::INPUT;
use mateval_dataset::manifest::{self, sha256_of_bytes};
use mateval_dataset::open::Dataset;
use mateval_dataset::render_file::ScorerFile;
use mateval_dataset::render_file::{RENDER_FILE, RenderFile};
use mateval_dataset::{RendererId, SceneError, SceneId, ViewId, json};
use mateval_eval::light::reference::RELEASE_SAMPLES;
use mateval_image::png_io::jpeg_bytes;
use mateval_image::store::write_whole;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_prep::recipe::{self, RECIPE};
use mateval_prep::render::RendererKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::given::ReleaseError;

/// The noise of one view of the photo's renderer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewNoise {
    /// The view.
    pub view: ViewId,
    /// As in `render.json`: linear, before exposure.
    pub mean_of_halves_mse: f64,
    /// As in `render.json`: linear, before exposure; may be below 0.
    pub denoised_mse: f64,
    /// PSNR of the mean of the halves against the picture without noise, in dB: linear, with the scene's exposure, for a
    /// peak of 1. Null where there is no noise.
    pub mean_of_halves_psnr_db: Option<f64>,
}

/// The pictures that were rendered with the same settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderedWith {
    /// The renderer.
    pub renderer: RendererId,
    /// The renderer's own version; null for `builtin`.
    pub renderer_version: Option<String>,
    /// Samples per pixel of each of the two halves.
    pub samples_each_half: u32,
    /// The denoiser of the pictures that are shown.
    pub denoiser: String,
    /// Number of views.
    pub views: usize,
    /// The scenes of these views, in the dataset's order.
    pub scenes: Vec<SceneId>,
}

/// The settings of all pictures, in the order of the renderers and then of the scenes.
pub(crate) fn rendered_with(dataset: &Dataset) -> Result<Vec<RenderedWith>, ReleaseError> {
    let mut all: Vec<RenderedWith> = Vec::new();
    for renderer in RendererKind::ALL.map(RendererKind::id) {
        for scene in &dataset.scenes {
            for view in &scene.views {
                if let Some(file) = render_file(dataset, scene, &renderer, &view.id)? {
                    add(&mut all, &scene.id, file);
                }
            }
        }
    }
    Ok(all)
}

fn add(all: &mut Vec<RenderedWith>, scene: &SceneId, file: RenderFile) {
    let is_same = |known: &RenderedWith| {
        (&known.renderer, &known.renderer_version, known.samples_each_half, &known.denoiser)
            == (&file.renderer, &file.renderer_version, file.samples_each_half, &file.denoiser)
    };
    let at = all.iter().position(is_same).unwrap_or(all.len());
    if at == all.len() {
        all.push(RenderedWith {
            renderer: file.renderer,
            renderer_version: file.renderer_version,
            samples_each_half: file.samples_each_half,
            denoiser: file.denoiser,
            views: 0,
            scenes: Vec::new(),
        });
    }
    all[at].views += 1;
    if all[at].scenes.last() != Some(scene) {
        all[at].scenes.push(scene.clone());
    }
}

/// The noise of a scene's views; none where the scene is not rendered.
pub(crate) fn noise(dataset: &Dataset, scene: &SceneFile) -> Result<Option<Vec<ViewNoise>>, ReleaseError> {
    let Some(renderer) = dataset.photo_renderer(scene) else { return Ok(None) };
    let mut views = Vec::new();
    for view in &scene.views {
        if let Some(file) = render_file(dataset, scene, renderer, &view.id)? {
            let mse = file.noise.mean_of_halves_mse;
            let exposed = mse * scene.exposure * scene.exposure;
            views.push(ViewNoise {
                view: view.id.clone(),
                mean_of_halves_mse: mse,
                denoised_mse: file.noise.denoised_mse,
                mean_of_halves_psnr_db: (exposed > 0.0).then(|| -10.0 * libm::log10(exposed)),
            });
        }
    }
    Ok(Some(views))
}

/// The view's `render.json`; none where the renderer has not rendered it.
fn render_file(
    dataset: &Dataset,
    scene: &SceneFile,
    renderer: &RendererId,
    view: &ViewId,
) -> Result<Option<RenderFile>, ReleaseError> {
    let path = dataset.folder(&scene.id).render(renderer, view).join(RENDER_FILE);
    Ok(path.is_file().then(|| json::read(&path)).transpose()?)
}

/// The folder of the pictures in the report's folder.
const PICTURES: &str = "pictures";

/// The most pixels of a row.
const MOST_WIDTH: usize = 240;

/// The quality of JPEG: the pictures are looked at only.
const QUALITY: u8 = 85;

/// A small picture of a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Thumbnail {
    /// Its file, relative to the report's folder.
    pub file: String,
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Writes the picture of a scene below `out`; none where the input view has not been rendered.
pub(crate) fn write_thumbnail(
    dataset: &Dataset,
    scene: &SceneFile,
    out: &Path,
) -> Result<Option<Thumbnail>, ReleaseError> {
    let Some(view) = scene.view(INPUT) else { return Ok(None) };
    let path = dataset.folder(&scene.id).view(&view.id).join("rgb.png");
    if !path.is_file() {
        return Ok(None);
    }
    let small = reduced(&png_io::read_srgb(&path)?.to_linear());
    let bytes = small.map(|LinearRgb(rgb)| rgb.map(|v| byte_from_unit(srgb_from_linear(v))));
    let jpeg = jpeg_bytes(&bytes, QUALITY).expect("a picture of 1 to 240 columns has a JPEG");
    let file = format!("{PICTURES}/{}.jpg", scene.id);
    let place = out.join(&file);
    let folder = place.parent().unwrap_or(out);
    std::fs::create_dir_all(folder).map_err(SceneError::io("make", folder))?;
    write_whole(&place, &jpeg)?;
    Ok(Some(Thumbnail { file, width: small.width(), height: small.height() }))
}

/// The means of square blocks of pixels, of at most [`MOST_WIDTH`] blocks in a row. The last column and row may be cut.
fn reduced(picture: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    let side = picture.width().div_ceil(MOST_WIDTH).min(picture.height()).max(1);
    let mean = |x: usize, y: usize| {
        let pixels = (0..side * side).map(|at| picture.get(side * x + at % side, side * y + at / side).0);
        let sums = pixels.fold([0.0f64; 3], |sum, rgb| [0, 1, 2].map(|c| sum[c] + f64::from(rgb[c])));
        LinearRgb(sums.map(|sum| (sum / (side * side) as f64) as f32))
    };
    Picture::from_fn(picture.width() / side, picture.height() / side, mean)
}

/// The source's files of one scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneInputs {
    /// Number of files.
    pub files: usize,
    /// SHA-256, in hexadecimal, of a line `<sha256>  <path>` for each of `source.files` in `scene.json`, in their
    /// order.
    pub sha256: String,
}

impl SceneInputs {
    pub(crate) fn of(scene: &SceneFile) -> Self {
        let files = &scene.source.files;
        let lines: String = files.iter().map(|file| format!("{}  {}\n", file.sha256, file.path)).collect();
        Self { files: files.len(), sha256: sha256_of_bytes(lines.as_bytes()) }
    }
}

/// A licence text and the scenes that it is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SharedLicence {
    /// Its file, relative to the source of the first of these scenes.
    pub file: String,
    /// The whole text.
    pub text: String,
    /// The scenes, in the dataset's order.
    pub scenes: Vec<SceneId>,
}

/// Every licence text once, in the order of the first scene of each.
pub(crate) fn licences(dataset: &DatasetFile) -> Vec<SharedLicence> {
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut all: Vec<SharedLicence> = Vec::new();
    for licence in &dataset.licences {
        let at = *places.entry(&licence.text).or_insert(all.len());
        if at == all.len() {
            all.push(SharedLicence { file: licence.file.clone(), text: licence.text.clone(), scenes: Vec::new() });
        }
        all[at].scenes.push(licence.scene.clone());
    }
    all
}

/// The scenes for which the dataset states no licence.
pub(crate) fn without_licence(dataset: &DatasetFile) -> Vec<SceneId> {
    let has = |id: &SceneId| dataset.licences.iter().any(|licence| licence.scene == *id);
    dataset.scenes.iter().filter(|id| !has(id)).cloned().collect()
}

/// How to make the release again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Remake {
    /// The program that made the dataset and its version.
    pub tool: String,
    /// SHA-256 of `recipe.toml`, in hexadecimal.
    pub recipe_sha256: String,
    /// The text of `recipe.toml`.
    pub recipe: String,
    /// The commands, in their order; the last prints the hash of the manifest.
    pub commands: Vec<String>,
}

impl Remake {
    pub(crate) fn of(dataset: &Dataset, rendered: &[RenderedWith]) -> Result<Self, ReleaseError> {
        let (recipe, text) = recipe::read(&dataset.root.join(RECIPE))?;
        let left_out: Vec<&str> = recipe
            .scenes
            .iter()
            .map(|e| &e.id)
            .filter(|id| !dataset.file.scenes.contains(id))
            .map(|id| id.as_str())
            .collect();
        let mut commands = build_commands(dataset, &left_out);
        commands.extend(rendered.iter().map(|one| render_command(one, recipe.samples, dataset)));
        commands.push("sha256sum DATASET/MANIFEST.sha256".to_owned());
        let recipe_sha256 = sha256_of_bytes(text.as_bytes());
        Ok(Self { tool: dataset.file.tool.clone(), recipe_sha256, recipe: text, commands })
    }
}

/// Scenes that were left out may be ones that cannot be built, so that the others are then named one by one.
fn build_commands(dataset: &Dataset, left_out: &[&str]) -> Vec<String> {
    let whole = "mateval prep build recipe.toml --source SOURCE --out DATASET".to_owned();
    if left_out.is_empty() {
        return vec![whole];
    }
    let scenes = options("scene", dataset.file.scenes.iter().map(|id| id.as_str()));
    let without = options("without", left_out.iter().copied());
    vec![format!("{whole}{scenes}"), format!("mateval prep finish DATASET{without}")]
}

/// The command makes the scorer's references of the scenes too, if they exist.
fn render_command(with: &RenderedWith, recipe_samples: u32, dataset: &Dataset) -> String {
    let samples = with.samples_each_half;
    let samples = if samples == recipe_samples { String::new() } else { format!(" --samples {samples}") };
    let is_whole = with.scenes.len() == dataset.file.scenes.len();
    let scenes = if is_whole { String::new() } else { options("scene", with.scenes.iter().map(|id| id.as_str())) };
    let finish = if is_whole { "" } else { " && mateval prep finish DATASET" };
    let reference = reference(dataset, &with.scenes);
    format!("mateval prep render DATASET --renderer {}{samples}{reference}{scenes}{finish}", with.renderer)
}

/// The options that make the scenes' references as they are, which have the same number of samples.
fn reference(dataset: &Dataset, scenes: &[SceneId]) -> String {
    let file = |scene: &SceneId| json::read::<ScorerFile>(&dataset.folder(scene).scorer_file()).ok();
    match scenes.first().map(|scene| file(scene).map(|file| file.samples_each_half)) {
        Some(None) => " --only photo".to_owned(),
        Some(Some(samples)) if samples != RELEASE_SAMPLES => format!(" --scorer-samples {samples}"),
        _ => String::new(),
    }
}

/// ` --NAME ID` for each id.
fn options<'a>(name: &str, ids: impl Iterator<Item = &'a str>) -> String {
    ids.map(|id| format!(" --{name} {id}")).collect()
}

/// What the release scores: the last three rows of Table I.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Evaluated {
    /// Whether input views are scored.
    pub original_view: bool,
    /// Whether other views are scored.
    pub novel_view: bool,
    /// Whether every scored view has its true albedo.
    pub albedo: bool,
}

impl Evaluated {
    pub(crate) fn of(dataset: &Dataset) -> Result<Self, ReleaseError> {
        let targets = &dataset.targets.targets;
        let is_input = |target: &&Target| target.view.as_str() == INPUT;
        let files: std::collections::BTreeSet<String> =
            manifest::entries(&dataset.root)?.into_iter().map(|entry| entry.file).collect();
        let albedo = |target: &Target| {
            files.contains(&format!("scenes/{}/ground_truth/views/{}/albedo.exr", target.scene, target.view))
        };
        Ok(Self {
            original_view: targets.iter().any(|target| is_input(&target)),
            novel_view: !targets.iter().all(|target| is_input(&target)),
            albedo: !targets.is_empty() && targets.iter().all(albedo),
        })
    }
}

/// A row: the three columns of the paper (MatEval, PSDR-Room, PhotoScene), and the release.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Row {
    pub(crate) title: &'static str,
    pub(crate) paper: [&'static str; 3],
    pub(crate) ours: String,
}

const YES: &str = "✓";
const NO: &str = "✗";

/// All rows, the release's numbers rounded as the paper's.
pub(crate) fn rows(stats: &StatsFile, evaluated: Evaluated) -> Vec<Row> {
    let row = |title, paper, ours| Row { title, paper, ours };
    let mean = |spread: Option<mateval_audit::stats::Spread>| {
        spread.map_or_else(|| "unknown".to_owned(), |spread| format!("{:.1}", spread.mean))
    };
    let mark = |is_scored: bool| if is_scored { YES } else { NO }.to_owned();
    vec![
        row("Number of scenes", ["184", "7", "70"], stats.scenes.to_string()),
        row("Avg. objects / scene", ["13.2", "not stated", "9.4"], mean(stats.objects_per_scene)),
        row("Avg. categories / scene", ["4.3", "not stated", "4.1"], mean(stats.super_categories_per_scene)),
        row("Original view eval.", [YES, YES, YES], mark(evaluated.original_view)),
        row("Novel view eval.", [YES, NO, NO], mark(evaluated.novel_view)),
        row("Albedo eval.", [YES, NO, NO], mark(evaluated.albedo)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_averaged() {
        let picture = Picture::from_fn(481, 7, |x, _| LinearRgb([(x % 3) as f32; 3]));
        let small = reduced(&picture);
        assert_eq!((small.width(), small.height()), (160, 2));
        assert!(small.pixels().iter().all(|pixel| *pixel == LinearRgb([1.0; 3])));
        let tiny = Picture::filled(3, 2, LinearRgb([0.5; 3]));
        assert_eq!(reduced(&tiny), tiny);
    }
}
