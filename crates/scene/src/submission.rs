//! A submission: `submission.json` and `scenes/<scene>/<instance>/{base_color,roughness,metallic}.{png,exr}`.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::findings::shortened;
use crate::ids::{InstanceId, SceneId};
use crate::{SceneError, json};

/// `submission.json`.
pub const SUBMISSION: &str = "submission.json";

/// The word for this version of a submission.
pub const SUBMISSION_FORMAT: &str = "mateval-submission/1";

/// Largest `submission.json` that is read, in bytes.
pub const MAX_SUBMISSION_BYTES: u64 = 1 << 20;

/// `submission.json`: who made this, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SubmissionFile {
    /// Always `mateval-submission/1`.
    pub format: String,
    /// The method's name, as tables show it.
    pub method: String,
    /// Anything that a reader should know: settings, training data, links.
    #[serde(default)]
    pub description: String,
    /// Where to read about the method; leaderboards link to it if it begins with `https://` or `http://`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub url: Option<String>,
    /// The licence of the method's code and weights, as in `MIT` or `CC-BY-NC-4.0`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// What it took, as its makers say; nobody checks it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
    /// `manifest_sha256` of the dataset that it was made for.
    pub dataset_manifest_sha256: String,
}

impl SubmissionFile {
    /// Reads a submission's own; fails where it is of another format.
    pub fn read(submission: &Path) -> Result<Self, SceneError> {
        let path = submission.join(SUBMISSION);
        let file: Self = json::read_within(&path, MAX_SUBMISSION_BYTES)?;
        if file.format == SUBMISSION_FORMAT {
            return Ok(file);
        }
        let what = format!("format '{}'; this version reads '{SUBMISSION_FORMAT}'", shortened(&file.format));
        Err(SceneError::Unsupported { path, what })
    }
}

/// What a method takes for a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// Seconds for a scene, on the average.
    #[schemars(range(min = 0.0))]
    pub seconds_a_scene: f64,
    /// On what, as in `one RTX 4090`.
    #[serde(default)]
    pub hardware: String,
}

/// Texels a side that a submission may use.
pub const MAP_SIZES: std::ops::RangeInclusive<usize> = 64..=4096;

/// What a missing base colour scores as, and what the grey baseline holds; linear.
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
