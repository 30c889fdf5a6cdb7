//! The faults of a recipe, all of which are reported at once, and the ranges of its numbers.

use std::path::PathBuf;

use mateval_dataset::{PartSetId, SceneId, ViewId};
use mateval_files::FileError;
use mateval_files::source_folder::BelowError;
use mateval_files::untrusted::{in_words, shortened};

/// Farthest that a camera may stand from the origin along an axis, in metres. Beyond that, neighbouring `f32` numbers
/// are centimetres apart.
pub(super) const FARTHEST_M: f64 = 1e6;
/// Least and most pixels of a picture's side.
pub(crate) const RESOLUTION: std::ops::RangeInclusive<u32> = 16..=8192;
/// Least and most texels of an atlas's side.
pub const ATLAS_SIZES: std::ops::RangeInclusive<u32> = 64..=4096;

#[derive(Debug, thiserror::Error)]
pub enum RecipeFault {
    /// The file is not TOML, or has other keys or types than a recipe.
    #[error("{}", in_words(.0.to_string().trim_end()))]
    Syntax(Box<toml::de::Error>),
    #[error("name = {found:?}: expected a name of at least one letter, without control characters")]
    Name { found: String },
    #[error("version = {found:?}: expected a version such as `0.1.0`, without control characters")]
    Version { found: String },
    #[error("it has no scene; add a [[scene]] with `id` and the key of a source")]
    NoScenes,
    #[error("samples = {found}: expected 1 to {most}")]
    Samples { found: u32, most: u32 },
    /// Two views have the same id, or one has the input view's.
    #[error("view '{id}' is listed twice ('input' is the id of the input view)")]
    RepeatedView { id: ViewId },
    #[error("view '{id}': found turns of {x_deg} and {y_deg} degrees, expected at most 90 about X and 180 about Y")]
    Turns { id: ViewId, x_deg: f64, y_deg: f64 },
    /// A turned view has the id of a wide one.
    #[error(
        "view '{id}': ids that begin with '{}' are those of views from other places; choose another id",
        ViewId::WIDE
    )]
    TurnedId { id: ViewId },
    /// A wide view has the id of a turned one.
    #[error("wide: view '{id}': the id must begin with '{}'", ViewId::WIDE)]
    WideId { id: ViewId },
    #[error("wide: count = {found}: expected {least} to {most}")]
    WideCount { found: u32, least: u32, most: u32 },
    /// The range of distances of wide views is out of range, or falls.
    #[error("wide: distance_m = {found:?}: expected two rising numbers from {least} to {most}")]
    WideDistance {
        found: [f64; 2],
        /// The smallest distance allowed, in metres.
        least: f64,
        /// The largest distance allowed, in metres.
        most: f64,
    },
    /// A wide view stands too near to the input camera, or too far.
    #[error("wide: view '{id}': offset_m = {found:?}: expected a length of {least} to {most} m")]
    WideOffset {
        id: ViewId,
        found: [f64; 3],
        /// The smallest length allowed, in metres.
        least: f64,
        /// The largest length allowed, in metres.
        most: f64,
    },
    #[error("{owner}: resolution = {found:?}: expected {} to {} a side", RESOLUTION.start(), RESOLUTION.end())]
    Resolution {
        /// The recipe or the scene, as messages name it.
        owner: String,
        /// Width and height in the recipe.
        found: [u32; 2],
    },
    #[error("{owner}: atlas_size = {found}: expected {} to {}", ATLAS_SIZES.start(), ATLAS_SIZES.end())]
    AtlasSize {
        /// The recipe or the scene, as messages name it.
        owner: String,
        found: u32,
    },
    #[error("scene '{scene}' is listed twice")]
    RepeatedScene { scene: SceneId },
    #[error("scene '{scene}': {fault}")]
    Scene { scene: SceneId, fault: RecipeSceneFault },
}

/// One fault of a scene in a recipe.
#[derive(Debug, thiserror::Error)]
pub enum RecipeSceneFault {
    #[error("expected exactly one of the keys `{}`", keys.join("`, `"))]
    NotOneSource {
        /// The keys that name a source.
        keys: &'static [&'static str],
    },
    #[error("a room needs a camera, as in `camera = {{ seed = 1 }}`")]
    NoCamera,
    #[error("`appearance_seed` needs `appearance = \"stated\"`")]
    UnusedSeed,
    /// The source cannot draw cameras and has no designers' cameras.
    #[error("`seed` and `designer` are for `front3d`")]
    CameraOfRooms,
    /// A camera is too far away, or its field of view is out of range.
    #[error("camera: expected coordinates of at most {FARTHEST_M} m and 0 < fov_y_deg < 179")]
    CameraRange,
    #[error("exposure = {found}: expected a number above 0")]
    Exposure { found: f64 },
    #[error("part_labels.{set} = '{}': expected a folder below {root}, relative to it", folder.display())]
    LabelFolder {
        set: PartSetId,
        folder: PathBuf,
        /// The folder that the path must be relative to, as messages name it.
        root: &'static str,
    },
    #[error("photo = '{}': expected a file below {root}, relative to it", file.display())]
    PhotoPath {
        file: PathBuf,
        /// The folder that the path must be relative to, as messages name it.
        root: &'static str,
    },
    #[error("inputs: '{file}': expected a path below the scene's folder")]
    InputPath { file: String },
    #[error("inputs: '{file}' = '{}': expected a SHA-256, 64 lower-case hexadecimal digits", shortened(found))]
    InputHash { file: String, found: String },
    /// A path of the source does not lie below the source's folder.
    #[error("{key}: {source}; name the folder that contains all paths of the scene with --source")]
    OutsideSource { key: &'static str, source: BelowError },
    /// A file or folder of the source does not exist.
    #[error("there is no {kind} '{}'; correct `{key}`, or name the folder with --source", path.display())]
    MissingSource {
        key: &'static str,
        /// `file` or `folder`.
        kind: &'static str,
        path: PathBuf,
    },
    #[error("input '{file}' does not exist, or is not an ordinary file")]
    MissingInput { file: String },
    #[error("input '{file}' cannot be hashed: {source}")]
    UnreadableInput { file: String, source: FileError },
    #[error("input '{file}' has the hash {found}, expected {pinned}; get the file that the release was made of")]
    ChangedInput { file: String, found: String, pinned: String },
}

/// Adds a [`RecipeFault`] for each size that is out of range. `owner` is the recipe or the scene, as messages name it.
pub(super) fn check_sizes(
    owner: &str,
    resolution: Option<[u32; 2]>,
    atlas_size: Option<u32>,
    faults: &mut Vec<RecipeFault>,
) {
    let owner = || owner.to_owned();
    if let Some(found) = resolution.filter(|sides| !sides.iter().all(|side| RESOLUTION.contains(side))) {
        faults.push(RecipeFault::Resolution { owner: owner(), found });
    }
    if let Some(found) = atlas_size.filter(|size| !ATLAS_SIZES.contains(size)) {
        faults.push(RecipeFault::AtlasSize { owner: owner(), found });
    }
}
