//! A recipe: the scenes that a dataset consists of, and the settings of their pictures and atlases.
//!
//! Paths are relative to the recipe's folder, or to the folder that `--source` names.

mod camera;
pub mod fault;
mod limits;
mod scene;
mod sizes;
#[cfg(test)]
mod tests;
mod text;
mod views;
mod wide;

use std::collections::BTreeSet;
use std::path::Path;

use mateval_scene::dataset::TrueMaterials;
use mateval_sources::front3d::camera_rules::CameraRules;
use serde::Deserialize;

use crate::error::PrepError;
pub use camera::{GivenCamera, RecipeCamera};
use fault::RecipeFault;
pub use limits::ATLAS_SIZES;
pub(crate) use limits::RESOLUTION;
pub(crate) use scene::SourcePath;
pub use scene::{AppearanceWord, Front3dRoom, RecipeScene, RecipeSource};
use sizes::check_sizes;
pub(crate) use text::read_text;
pub use views::Offset;
pub(crate) use views::default_views;
pub use wide::{DrawnViews, WideOffset, WideViews};

/// The name of the recipe in the dataset.
pub const RECIPE: &str = "recipe.toml";

/// The most samples a pixel.
pub const MOST_SAMPLES: u32 = 1 << 16;

/// A recipe as written.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The dataset's name.
    pub name: String,
    /// The dataset's version.
    #[serde(default = "default_version")]
    pub version: String,
    /// Width and height in pixels; if absent, the source's own.
    pub resolution: Option<[u32; 2]>,
    /// The novel views, as turns of the input camera; empty for a dataset of input views only.
    #[serde(default = "default_views")]
    pub views: Vec<Offset>,
    /// Novel views from other places; none if absent.
    pub wide: Option<WideViews>,
    /// Texels a side of every atlas; if absent, chosen by what the input view shows.
    pub atlas_size: Option<u32>,
    /// The materials of which the truth is made.
    #[serde(default)]
    pub materials: TrueMaterials,
    /// The rules of cameras that are drawn.
    #[serde(default, deserialize_with = "camera_rules")]
    pub camera_rules: CameraRules,
    /// Samples a pixel of each half of a rendered picture.
    #[serde(default = "default_samples")]
    pub samples: u32,
    /// The scenes.
    #[serde(default, rename = "scene")]
    pub scenes: Vec<RecipeScene>,
}

fn default_version() -> String {
    "0.1.0".to_owned()
}

fn default_samples() -> u32 {
    64
}

fn camera_rules<'de, D: serde::Deserializer<'de>>(words: D) -> Result<CameraRules, D::Error> {
    String::deserialize(words)?.parse().map_err(serde::de::Error::custom)
}

/// Reads a recipe. Returns also its text, which the dataset keeps. An error lists every fault of the recipe.
pub fn read(path: &Path) -> Result<(Recipe, String), PrepError> {
    let fault = |faults| PrepError::Recipe { path: path.to_owned(), faults };
    let text = read_text(path)?;
    let recipe: Recipe = toml::from_str(&text).map_err(|error| fault(vec![RecipeFault::Syntax(Box::new(error))]))?;
    let faults = recipe.faults();
    if faults.is_empty() { Ok((recipe, text)) } else { Err(fault(faults)) }
}

impl Recipe {
    fn faults(&self) -> Vec<RecipeFault> {
        let mut faults = Vec::new();
        if self.scenes.is_empty() {
            faults.push(RecipeFault::NoScenes);
        }
        if self.samples == 0 || self.samples > MOST_SAMPLES {
            faults.push(RecipeFault::Samples { found: self.samples, most: MOST_SAMPLES });
        }
        self.check_views(&mut faults);
        check_sizes("the recipe", self.resolution, self.atlas_size, &mut faults);
        let mut ids = BTreeSet::new();
        for scene in &self.scenes {
            if !ids.insert(&scene.id) {
                faults.push(RecipeFault::RepeatedScene { scene: scene.id.clone() });
            }
            scene.check(&mut faults);
        }
        faults
    }

    fn check_views(&self, faults: &mut Vec<RecipeFault>) {
        let mut seen = BTreeSet::from([mateval_scene::layout::INPUT]);
        let wide = self.wide.iter().flat_map(WideViews::given_ids);
        for id in self.views.iter().map(|view| &view.id).chain(wide) {
            if !seen.insert(id.as_str()) {
                faults.push(RecipeFault::RepeatedView { id: id.clone() });
            }
        }
        for view in &self.views {
            if view.id.is_wide() {
                faults.push(RecipeFault::TurnedId { id: view.id.clone() });
            }
            if !(view.x_deg.abs() <= 90.0 && view.y_deg.abs() <= 180.0) {
                faults.push(RecipeFault::Turns { id: view.id.clone(), x_deg: view.x_deg, y_deg: view.y_deg });
            }
        }
        self.wide.iter().for_each(|wide| wide.check(faults));
    }
}
