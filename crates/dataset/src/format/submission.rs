//! A submission: `submission.json` and `scenes/<scene>/<instance>/{base_color,roughness,metallic}.{png,exr}`, and the
//! transfer functions of the numbers that other projects' networks store in pictures.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_image::transfer::linear_from_srgb;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::dataset::Perturbation;
use crate::ids::{InstanceId, SceneId};
use crate::{DatasetError, Finding, Severity, json};

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
    /// Datasets that the method was trained on, as in `3D-FRONT`; boards mark those that their scenes come from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trained_on: Vec<String>,
    /// Whether it was made from the ground truth: a bound, and no method.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub oracle: bool,
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
    /// Parses the bytes of a submission's file; `path` is for the error alone. Fails where its format is another one,
    /// and where a number is out of range.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, DatasetError> {
        let file: Self = json::parse_format(path, bytes, SUBMISSION_FORMAT)?;
        let findings = file.numbers_out_of_range();
        match findings.is_empty() {
            true => Ok(file),
            false => Err(DatasetError::Invalid { path: path.to_owned(), findings }),
        }
    }

    /// A finding for each number that has no meaning, which would stand in tables and curves.
    pub fn numbers_out_of_range(&self) -> Vec<Finding> {
        let found = |place: &str, message: String, action: &str| {
            Finding::new(Severity::Error, "bad_number", SUBMISSION, place, message, action)
        };
        // JSON has neither NaN nor infinities.
        let cost = self.cost.as_ref().filter(|cost| cost.seconds_a_scene < 0.0).map(|cost| {
            let message = format!("expected a number of at least 0, found {}", cost.seconds_a_scene);
            found("/cost/seconds_a_scene", message, "write the seconds for one scene, or leave out `cost`")
        });
        let geometry = self.geometry.filter(|it| !(1..=it.kind.most_level()).contains(&it.level)).map(|it| {
            let message = format!("{} has the levels 1 to {}, found {}", it.kind, it.kind.most_level(), it.level);
            let action = "copy `perturbation` of the dataset's dataset.json, or leave out `geometry` for the true one";
            found("/geometry/level", message, action)
        });
        cost.into_iter().chain(geometry).collect()
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

/// The perceptual roughness that replaces a missing map.
pub const MISSING_ROUGHNESS: f32 = 0.5;

/// The metallic that replaces a missing map.
pub const MISSING_METALLIC: f32 = 0.0;

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

crate::word_enum! {
    StoredEncoding, a "stored encoding":
    /// Linear.
    Linear = "linear",
    /// IEC 61966-2-1.
    Srgb = "srgb",
    /// A power of 2.2.
    Gamma22 = "gamma22",
}

impl StoredEncoding {
    /// The linear value of a stored number; negative numbers count as 0.
    pub fn decode(self, stored: f32) -> f32 {
        let stored = stored.max(0.0);
        match self {
            Self::Linear => stored,
            Self::Srgb => linear_from_srgb(stored),
            Self::Gamma22 => libm::powf(stored, 2.2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0.5 encoded: 0.5, 0.2140 (IEC 61966-2-1) and 0.5^2.2 = 0.2176.
    #[test]
    fn known_values() {
        let decoded = StoredEncoding::ALL.iter().map(|encoding| encoding.decode(0.5));
        for (found, expected) in decoded.zip([0.5, 0.214_041, 0.217_638]) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        assert_eq!(StoredEncoding::Gamma22.decode(-1.0), 0.0);
    }
}
