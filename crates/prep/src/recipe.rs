//! A recipe: which scenes a dataset is made of, and how.
//!
//! Paths are relative to the recipe's folder, or to the folder that `--source` names.

use std::path::{Path, PathBuf};

use mateval_scene::{SceneId, ViewId};
use serde::Deserialize;

use crate::error::PrepError;

/// A recipe as written.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The dataset's name.
    pub name: String,
    /// The dataset's version.
    #[serde(default = "default_version")]
    pub version: String,
    /// Width and height in pixels; the source's own where absent.
    pub resolution: Option<[u32; 2]>,
    /// The novel views, as turns of the input camera; none of them for a dataset of input views only.
    #[serde(default = "default_views")]
    pub views: Vec<Offset>,
    /// Texels a side of every atlas; chosen by what the input view shows where absent.
    pub atlas_size: Option<u32>,
    /// Samples a pixel of each half of a rendered picture.
    #[serde(default = "default_samples")]
    pub samples: u32,
    /// The scenes.
    #[serde(rename = "scene")]
    pub scenes: Vec<RecipeScene>,
}

/// A novel view: the input camera turned about its own axes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Offset {
    /// The view's id.
    pub id: ViewId,
    /// Degrees about X, up is positive.
    pub x_deg: f64,
    /// Degrees about Y, after X; left is positive.
    pub y_deg: f64,
}

/// One scene of a recipe.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecipeScene {
    /// Its id.
    pub id: SceneId,
    /// Its Mitsuba XML.
    pub bitterli: PathBuf,
    /// The scene that it is a variant of, for rankings; its folder's name where absent.
    pub house: Option<String>,
    /// Overrides the source's own camera.
    pub camera: Option<GivenCamera>,
    /// Overrides the recipe's.
    pub resolution: Option<[u32; 2]>,
    /// Overrides the recipe's.
    pub atlas_size: Option<u32>,
    /// Multiplies every RGB picture before clipping.
    #[serde(default = "default_exposure")]
    pub exposure: f64,
}

/// A camera by hand.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GivenCamera {
    /// Metres.
    pub position: [f64; 3],
    /// A point in the middle of the picture, metres.
    pub target: [f64; 3],
    /// Vertical field of view in degrees.
    pub fov_y_deg: f64,
}

fn default_version() -> String {
    "0.1.0".to_owned()
}

fn default_samples() -> u32 {
    64
}

fn default_exposure() -> f64 {
    1.0
}

fn default_views() -> Vec<Offset> {
    [("up_left", 5.0, 5.0), ("up_right", 5.0, -5.0), ("down_left", -5.0, 5.0), ("down_right", -5.0, -5.0)]
        .map(|(id, x_deg, y_deg)| Offset { id: ViewId::new(id).expect("our own ids are ids"), x_deg, y_deg })
        .to_vec()
}

/// Largest recipe that is read, in bytes.
const MAX_RECIPE_BYTES: u64 = 16 << 20;
/// Least and most pixels of a side.
pub(crate) const RESOLUTION: std::ops::RangeInclusive<u32> = 16..=8192;
/// Least and most texels of an atlas's side.
pub const ATLAS_SIZES: std::ops::RangeInclusive<u32> = 64..=4096;

/// Reads a recipe; gives its text too, which the dataset keeps. Every fault is named at once.
pub fn read(path: &Path) -> Result<(Recipe, String), PrepError> {
    let length = std::fs::metadata(path).map_err(PrepError::io("read", path))?.len();
    let fault = |faults| PrepError::Recipe { path: path.to_owned(), faults };
    if length > MAX_RECIPE_BYTES {
        return Err(fault(vec![format!("{length} bytes; expected at most {MAX_RECIPE_BYTES}")]));
    }
    let text = std::fs::read_to_string(path).map_err(PrepError::io("read", path))?;
    let recipe: Recipe = toml::from_str(&text).map_err(|error| fault(vec![error.to_string().trim_end().to_owned()]))?;
    let faults = recipe.faults();
    if faults.is_empty() { Ok((recipe, text)) } else { Err(fault(faults)) }
}

impl Recipe {
    fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if self.scenes.is_empty() {
            faults.push("names no scene; add a [[scene]] with `id` and `bitterli`".to_owned());
        }
        if self.samples == 0 || self.samples > 1 << 16 {
            faults.push(format!("samples = {}: expected 1 to 65536", self.samples));
        }
        let mut seen = std::collections::BTreeSet::from(["input"]);
        for view in &self.views {
            if !seen.insert(view.id.as_str()) {
                faults.push(format!("view '{}' is there twice ('input' is the input view's own id)", view.id));
            }
            if !(view.x_deg.abs() <= 90.0 && view.y_deg.abs() <= 180.0) {
                faults.push(format!("view '{}': turns of {} and {} degrees", view.id, view.x_deg, view.y_deg));
            }
        }
        check_sizes("the recipe", self.resolution, self.atlas_size, &mut faults);
        let mut ids = std::collections::BTreeSet::new();
        for scene in &self.scenes {
            if !ids.insert(&scene.id) {
                faults.push(format!("scene '{}' is there twice", scene.id));
            }
            check_sizes(&format!("scene '{}'", scene.id), scene.resolution, scene.atlas_size, &mut faults);
            scene.check(&mut faults);
        }
        faults
    }
}

impl RecipeScene {
    fn check(&self, faults: &mut Vec<String>) {
        if !(self.exposure > 0.0 && self.exposure.is_finite()) {
            faults.push(format!("scene '{}': exposure = {}: expected a number above 0", self.id, self.exposure));
        }
        if let Some(camera) = &self.camera {
            let finite = camera.position.iter().chain(&camera.target).all(|v| v.is_finite());
            let field = camera.fov_y_deg > 0.0 && camera.fov_y_deg < 179.0;
            if !finite || !field {
                faults.push(format!("scene '{}': camera: expected finite points and 0 < fov_y_deg < 179", self.id));
            }
        }
    }
}

fn check_sizes(what: &str, resolution: Option<[u32; 2]>, atlas_size: Option<u32>, faults: &mut Vec<String>) {
    if let Some(sides) = resolution
        && !sides.iter().all(|side| RESOLUTION.contains(side))
    {
        faults.push(format!("{what}: resolution = {sides:?}: expected 16 to 8192 a side"));
    }
    if let Some(size) = atlas_size
        && !ATLAS_SIZES.contains(&size)
    {
        faults.push(format!("{what}: atlas_size = {size}: expected 64 to 4096"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Recipe, PrepError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("recipe.toml");
        std::fs::write(&path, text).unwrap();
        read(&path).map(|(recipe, _)| recipe)
    }

    #[test]
    fn the_least_recipe() {
        let recipe = read_text("name = 'mini'\n[[scene]]\nid = 'a'\nbitterli = 'a/scene.xml'").unwrap();
        assert_eq!(recipe.views.len(), 4);
        assert_eq!(
            (recipe.views[1].id.as_str(), recipe.views[1].x_deg, recipe.views[1].y_deg),
            ("up_right", 5.0, -5.0)
        );
        assert_eq!((recipe.samples, recipe.scenes[0].exposure), (64, 1.0));
    }

    #[test]
    fn every_fault_at_once() {
        let text = "name = 'x'\nresolution = [4, 9]\nsamples = 0\n\
            [[scene]]\nid = 'a'\nbitterli = 'a'\nexposure = 0.0\n[[scene]]\nid = 'a'\nbitterli = 'b'\natlas_size = 9";
        let error = read_text(text).unwrap_err().to_string();
        for part in ["resolution = [4, 9]", "samples = 0", "'a' is there twice", "exposure = 0", "atlas_size = 9"] {
            assert!(error.contains(part), "{part} not in {error}");
        }
    }

    #[test]
    fn unknown_words_are_refused_with_their_line() {
        let error = read_text("name = 'x'\nresolutoin = [4, 9]").unwrap_err().to_string();
        assert!(error.contains("resolutoin") && error.contains("line 2"), "{error}");
    }
}
