//! A recipe: which scenes a dataset is made of, and how.
//!
//! Paths are relative to the recipe's folder, or to the folder that `--source` names.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_image::limits::read_at_most;
use mateval_scene::{PartSetId, SceneId, ViewId};
use serde::Deserialize;

use crate::error::PrepError;
use mateval_scene::findings::shortened;
use mateval_scene::source_folder::SourceFolder;

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
    #[serde(default, rename = "scene")]
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
    /// Its Mitsuba XML; this or `front3d`.
    pub bitterli: Option<PathBuf>,
    /// A room of a 3D-FRONT house; this or `bitterli`.
    pub front3d: Option<Front3dRoom>,
    /// The scene that it is a variant of, for rankings; its folder's name, or its house's uid, where absent.
    pub house: Option<String>,
    /// The input camera; a Mitsuba scene has its own where absent.
    pub camera: Option<RecipeCamera>,
    /// Folders with `<instance>.npy`, a label for each triangle: other ways to split the instances into parts, by name.
    #[serde(default)]
    pub part_labels: BTreeMap<PartSetId, PathBuf>,
    /// SHA-256 of every file that the scene is made of, by its path as `scene.json` lists it under `source`: the scene is
    /// made of these very bytes or not at all. Not checked where empty.
    #[serde(default)]
    pub inputs: BTreeMap<String, String>,
    /// Overrides the recipe's.
    pub resolution: Option<[u32; 2]>,
    /// Overrides the recipe's.
    pub atlas_size: Option<u32>,
    /// Multiplies every RGB picture before clipping.
    #[serde(default = "default_exposure")]
    pub exposure: f64,
}

/// A room of a 3D-FRONT house, and where everything for it is.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Front3dRoom {
    /// The house's JSON.
    pub house: PathBuf,
    /// The room's instanceid, as in `LivingDiningRoom-1912`.
    pub room: String,
    /// The folder of 3D-FUTURE's models.
    pub models: PathBuf,
    /// The folder of the layout's textures; without it the architecture has its colours only.
    pub textures: Option<PathBuf>,
    /// A file of designers' cameras beside the house.
    pub cameras: Option<PathBuf>,
    /// Mirror the layout as BlenderProc does.
    #[serde(default)]
    pub blenderproc_compat: bool,
}

/// The input camera, as a recipe says it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "CameraWords")]
pub enum RecipeCamera {
    /// By hand.
    Given(GivenCamera),
    /// Found by drawing cameras in the room until one sees enough; the same seed finds the same one.
    Seed {
        /// Of the draw.
        seed: u64,
        /// Vertical field of view in degrees.
        fov_y_deg: f64,
    },
    /// A designer's, by its number; its field of view is kept.
    Designer(usize),
}

/// A camera by hand.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenCamera {
    /// Metres.
    pub position: [f64; 3],
    /// A point in the middle of the picture, metres.
    pub target: [f64; 3],
    /// Vertical field of view in degrees.
    pub fov_y_deg: f64,
}

/// A camera's keys as they stand in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraWords {
    position: Option<[f64; 3]>,
    target: Option<[f64; 3]>,
    fov_y_deg: Option<f64>,
    seed: Option<u64>,
    designer: Option<usize>,
}

/// Vertical field of view of cameras that are drawn, in degrees, where the recipe names none.
pub const DRAWN_FOV_Y_DEG: f64 = 45.0;

impl TryFrom<CameraWords> for RecipeCamera {
    type Error = String;

    fn try_from(words: CameraWords) -> Result<Self, String> {
        match words {
            CameraWords {
                position: Some(position),
                target: Some(target),
                fov_y_deg: Some(fov_y_deg),
                seed: None,
                designer: None,
            } => Ok(Self::Given(GivenCamera { position, target, fov_y_deg })),
            CameraWords { position: None, target: None, fov_y_deg, seed: Some(seed), designer: None } => {
                Ok(Self::Seed { seed, fov_y_deg: fov_y_deg.unwrap_or(DRAWN_FOV_Y_DEG) })
            }
            CameraWords { position: None, target: None, fov_y_deg: None, seed: None, designer: Some(number) } => {
                Ok(Self::Designer(number))
            }
            _ => Err("camera: expected { position, target, fov_y_deg }, { seed } (with or without fov_y_deg), or \
                      { designer }"
                .to_owned()),
        }
    }
}

/// Where a scene comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecipeSource<'a> {
    /// A Mitsuba XML.
    Bitterli(&'a Path),
    /// A room of a 3D-FRONT house.
    Front3d(&'a Front3dRoom),
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

/// The paper's four turns by five degrees.
pub(crate) fn default_views() -> Vec<Offset> {
    [("up_left", 5.0, 5.0), ("up_right", 5.0, -5.0), ("down_left", -5.0, 5.0), ("down_right", -5.0, -5.0)]
        .map(|(id, x_deg, y_deg)| Offset { id: ViewId::new(id).expect("our own ids are ids"), x_deg, y_deg })
        .to_vec()
}

/// Largest recipe, and file of rules, that is read, in bytes.
const MAX_RECIPE_BYTES: u64 = 16 << 20;
/// Farthest that a camera may stand, in metres along an axis: beyond, neighbouring numbers are centimetres apart.
const FARTHEST_M: f64 = 1e6;
/// Least and most pixels of a side.
pub(crate) const RESOLUTION: std::ops::RangeInclusive<u32> = 16..=8192;
/// Least and most texels of an atlas's side.
pub const ATLAS_SIZES: std::ops::RangeInclusive<u32> = 64..=4096;

/// Reads a recipe; gives its text too, which the dataset keeps. Every fault is named at once.
pub fn read(path: &Path) -> Result<(Recipe, String), PrepError> {
    let fault = |faults| PrepError::Recipe { path: path.to_owned(), faults };
    let text = read_text(path)?;
    let recipe: Recipe = toml::from_str(&text).map_err(|error| fault(vec![error.to_string().trim_end().to_owned()]))?;
    let faults = recipe.faults();
    if faults.is_empty() { Ok((recipe, text)) } else { Err(fault(faults)) }
}

/// The text of an ordinary file of at most [`MAX_RECIPE_BYTES`].
pub(crate) fn read_text(path: &Path) -> Result<String, PrepError> {
    let bytes = read_at_most(path, MAX_RECIPE_BYTES).map_err(PrepError::io("read", path))?;
    let no_text = |_| std::io::Error::new(std::io::ErrorKind::InvalidData, "expected UTF-8, found other bytes");
    String::from_utf8(bytes).map_err(no_text).map_err(PrepError::io("read", path))
}

impl Recipe {
    fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if self.scenes.is_empty() {
            faults.push("names no scene; add a [[scene]] with `id` and `bitterli` or `front3d`".to_owned());
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
    /// Where it comes from; in words what is wrong where the recipe names no source or two.
    pub fn source(&self) -> Result<RecipeSource<'_>, String> {
        match (&self.bitterli, &self.front3d) {
            (Some(xml), None) => Ok(RecipeSource::Bitterli(xml)),
            (None, Some(room)) => Ok(RecipeSource::Front3d(room)),
            _ => Err(format!("scene '{}': expected one of `bitterli` and `front3d`", self.id)),
        }
    }

    /// The folder that the paths of the scene's files are relative to: the XML's, or `source`, where the recipe's paths are.
    pub fn root(&self, source: &Path) -> PathBuf {
        match &self.bitterli {
            Some(xml) => source.join(xml).parent().map(Path::to_owned).unwrap_or_default(),
            None => source.to_owned(),
        }
    }

    fn check(&self, faults: &mut Vec<String>) {
        match (self.source(), &self.camera) {
            (Err(fault), _) => faults.push(fault),
            (Ok(RecipeSource::Front3d(_)), None) => {
                faults.push(format!("scene '{}': a room needs a camera, as in `camera = {{ seed = 1 }}`", self.id));
            }
            (Ok(RecipeSource::Bitterli(_)), Some(RecipeCamera::Seed { .. } | RecipeCamera::Designer(_))) => {
                faults.push(format!("scene '{}': `seed` and `designer` are for `front3d`", self.id));
            }
            (Ok(_), _) => {}
        }
        for (set, folder) in &self.part_labels {
            if SourceFolder::relative(&folder.to_string_lossy()).is_err() {
                let below = if self.bitterli.is_some() { "the XML's folder" } else { "where the recipe's paths are" };
                faults.push(format!(
                    "scene '{}': part_labels.{set} = '{}': expected a folder below {below}, relative to it",
                    self.id,
                    folder.display()
                ));
            }
        }
        if !(self.exposure > 0.0 && self.exposure.is_finite()) {
            faults.push(format!("scene '{}': exposure = {}: expected a number above 0", self.id, self.exposure));
        }
        for (file, hash) in &self.inputs {
            if SourceFolder::relative(file).is_err() {
                faults.push(format!("scene '{}': inputs: '{file}': expected a path below the scene's folder", self.id));
            }
            if hash.len() != 64 || !hash.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f')) {
                let what = "expected a SHA-256, 64 lower-case hexadecimal digits";
                faults.push(format!("scene '{}': inputs: '{file}' = '{}': {what}", self.id, shortened(hash)));
            }
        }
        let (near, field) = match &self.camera {
            Some(RecipeCamera::Given(camera)) => {
                (camera.position.iter().chain(&camera.target).all(|v| v.abs() <= FARTHEST_M), camera.fov_y_deg)
            }
            Some(RecipeCamera::Seed { fov_y_deg, .. }) => (true, *fov_y_deg),
            Some(RecipeCamera::Designer(_)) | None => (true, 60.0),
        };
        let sound = near && field > 0.0 && field < 179.0;
        if !sound {
            faults.push(format!(
                "scene '{}': camera: expected coordinates of at most {FARTHEST_M} m and 0 < fov_y_deg < 179",
                self.id
            ));
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
mod tests;
