//! A submission: `submission.json` and `scenes/<scene>/<instance>/{base_color,roughness,metallic}.{png,exr}`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ids::{InstanceId, SceneId};
use crate::perturbation::Perturbation;
use crate::stored_encoding::StoredEncoding;
use crate::{SceneError, json};

/// `submission.json`.
pub const SUBMISSION: &str = "submission.json";

/// The name of this version of a submission.
pub const SUBMISSION_FORMAT: &str = "mateval-submission/1";

/// Largest `submission.json` that is read, in bytes.
pub const MAX_SUBMISSION_BYTES: u64 = 1 << 20;

/// `submission.json`: the method and how it was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SubmissionFile {
    /// Always `mateval-submission/1`.
    pub format: String,
    /// The method's name, as tables show it.
    pub method: String,
    /// Settings, training data, links and whatever else readers should know.
    #[serde(default)]
    pub description: String,
    /// Where to read about the method; leaderboards link to it if it begins with `https://` or `http://`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub url: Option<String>,
    /// The licence of the method's code and weights, as in `MIT` or `CC-BY-NC-4.0`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// The cost as its makers state it, unchecked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
    /// By map, the encodings of the method's pictures that its authors do not state, and that the adapter assumed.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub assumed_encodings: BTreeMap<Map, StoredEncoding>,
    /// How the geometry that it was made from differs from the true one; absent where it was made from the true one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<Perturbation>,
    /// `manifest_sha256` of the dataset that it was made for.
    pub dataset_manifest_sha256: String,
}

impl SubmissionFile {
    /// Parses the bytes of a submission's file; `path` is for the error alone. Fails where its format is another one.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, SceneError> {
        json::parse_format(path, bytes, SUBMISSION_FORMAT)
    }
}

/// The cost of a method for one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// Seconds a scene, on average.
    #[schemars(range(min = 0.0))]
    pub seconds_a_scene: f64,
    /// The hardware, as in `one RTX 4090`.
    #[serde(default)]
    pub hardware: String,
}

/// The sides of a submission's maps that are allowed, in texels.
pub const MAP_SIZES: std::ops::RangeInclusive<usize> = 64..=4096;

/// The linear grey that a missing base colour scores as, and that the grey baseline writes.
pub const GREY: f32 = 0.5;

/// One of a material's maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Map {
    /// sRGB where PNG, linear where EXR.
    BaseColor,
    /// Linear, perceptual: alpha is its square.
    Roughness,
    /// Linear.
    Metallic,
}

impl Map {
    /// All three.
    pub const ALL: [Self; 3] = [Self::BaseColor, Self::Roughness, Self::Metallic];

    /// The file's name without its ending.
    pub fn stem(self) -> &'static str {
        match self {
            Self::BaseColor => "base_color",
            Self::Roughness => "roughness",
            Self::Metallic => "metallic",
        }
    }
}

/// The folder of one scene's instances.
pub fn scene_folder(submission: &Path, scene: &SceneId) -> PathBuf {
    submission.join("scenes").join(scene.as_str())
}

/// The folder of one instance's maps.
pub fn instance_folder(submission: &Path, scene: &SceneId, instance: &InstanceId) -> PathBuf {
    scene_folder(submission, scene).join(instance.as_str())
}
