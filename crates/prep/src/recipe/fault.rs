//! The faults of a recipe, all of which are reported at once, and the ranges of its numbers.

use std::path::PathBuf;

use mateval_dataset::dataset::SourceKind;
use mateval_dataset::lighting::LightingName;
use mateval_dataset::{SceneId, ViewId};
use mateval_files::FileError;
use mateval_files::source_folder::BelowError;
use mateval_files::untrusted::in_words;

use crate::redress::secret::SecretFault;

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
    #[error(transparent)]
    Value(#[from] ValueFault),
    #[error("it has no scene; add a [[scene]] with `id` and the key of a source")]
    NoScenes,
    /// Two views have the same id, or one has the input view's.
    #[error("view '{id}' is listed twice ('input' is the id of the input view)")]
    RepeatedView { id: ViewId },
    /// A turned view has the id of a wide one.
    #[error(
        "view '{id}': ids that begin with '{}' are those of views from other places; choose another id",
        ViewId::WIDE
    )]
    TurnedId { id: ViewId },
    /// A wide view has the id of a turned one.
    #[error("wide: view '{id}': the id must begin with '{}'", ViewId::WIDE)]
    WideId { id: ViewId },
    #[error("scene '{scene}' is listed twice")]
    RepeatedScene { scene: SceneId },
    #[error("scene '{scene}': {fault}")]
    Scene { scene: SceneId, fault: RecipeSceneFault },
}

/// A value that is out of range, or of another shape.
#[derive(Debug, thiserror::Error)]
#[error("{key} = {found}: expected {expected}")]
pub struct ValueFault {
    /// As in `samples`, or `wide: count`.
    key: String,
    found: String,
    expected: String,
}

impl ValueFault {
    pub(super) fn new(key: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { key: key.into(), found: found.into(), expected: expected.into() }
    }
}

/// One fault of a scene in a recipe.
#[derive(Debug, thiserror::Error)]
pub enum RecipeSceneFault {
    #[error(transparent)]
    Value(#[from] ValueFault),
    #[error("expected exactly one of the keys {}", source_keys())]
    NotOneSource,
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
    #[error("inputs: '{file}': expected a path below the scene's folder")]
    InputPath { file: String },
    #[error("`redress` changes the room, so that `photo` would show another; leave one of them out")]
    RedressedPhoto,
    #[error("`twins` need light groups, and the light of a `photo` is not known; leave one of them out")]
    PhotoTwins,
    /// A scene has the id of a twin of another one.
    #[error("it has the id of the twin '{lighting}' of scene '{of}'; choose another id")]
    TwinId { of: SceneId, lighting: LightingName },
    #[error("`{key}` does not go with `capture`, whose camera, photo and materials are those of a real room")]
    NotOfCaptures { key: &'static str },
    /// The scene cannot be redressed.
    #[error(transparent)]
    Secret(#[from] SecretFault),
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
    if let Some(found) = resolution.filter(|sides| !sides.iter().all(|side| RESOLUTION.contains(side))) {
        let expected = format!("{} to {} a side", RESOLUTION.start(), RESOLUTION.end());
        faults.push(ValueFault::new(format!("{owner}: resolution"), format!("{found:?}"), expected).into());
    }
    if let Some(found) = atlas_size.filter(|size| !ATLAS_SIZES.contains(size)) {
        let expected = format!("{} to {}", ATLAS_SIZES.start(), ATLAS_SIZES.end());
        faults.push(ValueFault::new(format!("{owner}: atlas_size"), found.to_string(), expected).into());
    }
}

fn source_keys() -> String {
    SourceKind::ALL.map(|kind| format!("`{kind}`")).join(", ")
}
