//! The commands that make a release again from its recipe and sources.

use mateval_eval::light::reference::RELEASE_SAMPLES;
use mateval_prep::recipe::{self, RECIPE};
use mateval_scene::manifest::sha256_of_bytes;
use mateval_scene::open::Dataset;
use mateval_scene::scorer_file::ScorerFile;
use mateval_scene::{SceneId, json};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReleaseError;
use crate::truth_renders::RenderedWith;

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
        let mut commands = build(dataset, &left_out);
        commands.extend(rendered.iter().map(|one| render(one, recipe.samples, dataset)));
        commands.push("sha256sum DATASET/MANIFEST.sha256".to_owned());
        let recipe_sha256 = sha256_of_bytes(text.as_bytes());
        Ok(Self { tool: dataset.file.tool.clone(), recipe_sha256, recipe: text, commands })
    }
}

/// Scenes that were left out may be ones that cannot be built, so that the others are then named one by one.
fn build(dataset: &Dataset, left_out: &[&str]) -> Vec<String> {
    let whole = "mateval prep build recipe.toml --source SOURCE --out DATASET".to_owned();
    if left_out.is_empty() {
        return vec![whole];
    }
    let scenes = options("scene", dataset.file.scenes.iter().map(|id| id.as_str()));
    let without = options("without", left_out.iter().copied());
    vec![format!("{whole}{scenes}"), format!("mateval prep finish DATASET{without}")]
}

/// The command makes the scorer's references of the scenes too, if they exist.
fn render(with: &RenderedWith, recipe_samples: u32, dataset: &Dataset) -> String {
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
