//! What it takes to make a release again: the source's files and their licences, the recipe, and the commands.

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::render_file::ScorerFile;
use mateval_dataset::{SceneId, json};
use mateval_eval::light::reference::RELEASE_SAMPLES;
use mateval_files::untrusted::sha256_of_bytes;
use mateval_prep::recipe::{self, RECIPE};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::renders::RenderedWith;
use crate::error::ReportError;

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
    pub(crate) fn of(dataset: &Dataset, rendered: &[RenderedWith]) -> Result<Self, ReportError> {
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

/// Those that a recipe lists: twins come with their scenes.
fn scenes(dataset: &Dataset) -> impl Iterator<Item = &str> {
    let file = &dataset.file;
    file.scenes.iter().filter(|id| !file.twins.contains_key(*id)).map(|id| id.as_str())
}

/// Scenes that were left out may be ones that cannot be built, so that the others are then named one by one.
fn build_commands(dataset: &Dataset, left_out: &[&str]) -> Vec<String> {
    let whole = "mateval prep build recipe.toml --source SOURCE --out DATASET".to_owned();
    if left_out.is_empty() {
        return vec![whole];
    }
    let scenes = options("scene", scenes(dataset));
    let without = options("without", left_out.iter().copied());
    vec![format!("{whole}{scenes}"), format!("mateval prep finish DATASET{without}")]
}

/// The command makes the scorer's references of the scenes too, if they exist.
fn render_command(with: &RenderedWith, recipe_samples: u32, dataset: &Dataset) -> String {
    let samples = with.samples_each_half;
    let samples = if samples == recipe_samples { String::new() } else { format!(" --samples {samples}") };
    let is_whole = with.scenes.len() == scenes(dataset).count();
    let scenes = if is_whole { String::new() } else { options("scene", with.scenes.iter().map(|id| id.as_str())) };
    let finish = if is_whole { "" } else { " && mateval prep finish DATASET" };
    let reference = reference(dataset, &with.scenes);
    let device = with.device.as_ref().map_or(String::new(), |device| format!(" --device {}", device.kind));
    format!("mateval prep render DATASET --renderer {}{device}{samples}{reference}{scenes}{finish}", with.renderer)
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
