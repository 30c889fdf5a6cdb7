//! The types of `RESULT.json`: every number, its inputs, and what is missing.

use std::collections::BTreeMap;

use mateval_dataset::dataset::Perturbation;
use mateval_dataset::lighting::LightingName;
use mateval_dataset::open::DatasetId;
use mateval_dataset::submission::Cost;
use mateval_dataset::word_enum::UnknownWord;
use mateval_dataset::{Finding, InstanceId, SceneId, ViewId, by_text};
use mateval_light::light_fit::FittedRadiances;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::metric::{Metric, PictureKind};
use crate::protocol::Protocol;
use crate::result::constancy::Constancy;
use crate::result::key::{PictureName, Region, ResultKey, Views};

pub mod constancy;
pub mod key;
pub mod means;

pub const RESULT_FORMAT: &str = "mateval-result/6";

/// A submission's scores on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultFile {
    /// Always `mateval-result/6`.
    pub format: String,
    /// Program and version, as in `mateval 0.1.0`.
    pub tool: String,
    /// The method's name, from submission.json.
    pub method: String,
    /// The submission that was scored.
    pub submission: SubmissionId,
    /// The dataset and the scored scenes.
    pub dataset: DatasetId,
    /// SHA-256 of the weights of each network; null where they were missing.
    pub lpips_weights: BTreeMap<String, Option<String>>,
    /// By name, the scores under each protocol.
    pub protocols: BTreeMap<String, ProtocolResult>,
    /// How far the answers to a scene and to its twins lie apart, for each scored scene whose twins it answers; absent
    /// where there is none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constancy: Vec<Constancy>,
    /// Maps that the submission holds for no instance of any scored scene, by their words in its files. They have no
    /// values; under light they are the default.
    pub not_predicted: Vec<String>,
    /// How far the scorer's tracer and Blender agree on this dataset, by `prep compare`; null where that was not run.
    pub tracer_check: Option<TracerCheck>,
    /// Metrics that could not be computed, each with the command that makes it available.
    pub missing: Vec<MissingMetric>,
    /// Faults of the submission and what was scored instead, sorted.
    pub findings: Vec<Finding>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SubmissionId {
    /// SHA-256, hex, over path and SHA-256 of submission.json and of every map of the scored scenes, in order.
    pub sha256: String,
    /// Its description, as stated by the submission.
    pub description: String,
    /// Where to read about it, as stated by the submission.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub url: Option<String>,
    /// The method's licence, as stated by the submission.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// What the method costs to run, as stated by the submission.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
    /// Datasets that the method was trained on, as stated by the submission.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trained_on: Vec<String>,
    /// Whether the submission states that it was made from the ground truth.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub oracle: bool,
    /// How the geometry that it was made from differs from the true one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<Perturbation>,
}

/// The scores of one protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProtocolResult {
    /// The rules.
    pub protocol: Protocol,
    /// Numbers of different fingerprints must not be compared.
    pub fingerprint: String,
    /// Mean over scenes. A PSNR that is a lower bound in a picture counts like any other.
    pub summary: BTreeMap<ResultKey, f64>,
    /// Mean over pictures of each scene, by the same keys.
    pub scenes: BTreeMap<SceneId, BTreeMap<ResultKey, f64>>,
    /// Standard errors of the means of PSNR of light in `summary` due to render noise, in dB. Left out unless every scene
    /// with a value has one in `noise`.
    pub summary_noise: BTreeMap<ResultKey, f64>,
    /// Standard errors of each scene's mean PSNR of light due to render noise, in dB, by the same keys. Left out where
    /// a picture has `lower_bound`.
    pub noise: BTreeMap<SceneId, BTreeMap<ResultKey, f64>>,
    /// By scene, the radiances that were fitted; only under `paper` and `capture-1`.
    pub fits: BTreeMap<SceneId, FittedRadiances>,
    /// The values of every picture over every region.
    pub pictures: Vec<PictureValues>,
    /// The errors of each instance's texels.
    pub texels: Vec<InstanceTexelErrors>,
    /// The errors of each instance's pixels.
    pub instances: Vec<InstancePixelErrors>,
    /// The regions whose colour was measured; only under `capture-1`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<MeasuredValues>,
}

/// Whether two renderers show the same rooms.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TracerCheck {
    /// Checks that were precise enough to say something.
    pub informative: usize,
    /// Those of them in which both agree.
    pub agree: usize,
}

/// The mean squared errors of one instance's texels, weighted by area.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstanceTexelErrors {
    /// The scene's id.
    pub scene: SceneId,
    /// The instance's id.
    pub instance: InstanceId,
    /// Texels that the input view sees.
    pub observed: TexelErrors,
    /// All other texels.
    pub unobserved: TexelErrors,
}

/// Means over texels by their area on the surface; null where there is no area.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TexelErrors {
    /// Square metres.
    pub area_m2: f64,
    /// Linear, mean over channels.
    pub base_color_mse: Option<f64>,
}

/// The squared error of one instance's pixels in one kind of picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstancePixelErrors {
    /// The scene's id.
    pub scene: SceneId,
    /// The instance's id.
    pub instance: InstanceId,
    /// The source's category; for architecture the kind of piece, as in `WallInner`; else null.
    pub category: Option<String>,
    /// The source's broader category; `Architecture` for architecture; else null.
    pub super_category: Option<String>,
    /// Albedo, aligned albedo, or light of track `true` or `fitted`.
    pub picture: PictureKind,
    /// `input`, `novel`, `unobserved`, `wide`, `wide_unobserved`.
    pub views: Views,
    /// Valid pixels that show it, in all of these views.
    pub pixels: usize,
    /// Mean over those pixels, in the colour space of the protocol's MSE of that picture; for light without render
    /// noise.
    pub mse: f64,
}

/// What a submission predicts for a region whose colour was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredValues {
    /// The scene's id.
    pub scene: SceneId,
    /// The view's id.
    pub view: ViewId,
    /// The region's name.
    pub region: String,
    /// The pixels whose mean `predicted` is.
    pub pixels: usize,
    /// The mean predicted base colour, linear Rec. 709.
    pub predicted: [f64; 3],
    /// The measured colour, linear Rec. 709.
    pub measured: [f64; 3],
    /// CIEDE2000 between both, without any scale.
    pub delta_e: f64,
    /// How far the measurement itself may be off, as CIEDE2000; absent where its error is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measurement_delta_e: Option<f64>,
}

/// The values of one picture over one region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PictureValues {
    /// The scene's id.
    pub scene: SceneId,
    /// The view's id.
    pub view: ViewId,
    /// What was compared; ends with `_specular` where only pixels that are metal or smooth in truth count.
    pub picture: PictureName,
    /// The lighting of a picture of kind `rgb_relit`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lighting: Option<LightingName>,
    /// The pixels that count.
    pub region: Region,
    /// Their number. SSIM of a mask is a mean over the windows that lie wholly inside.
    pub pixels: usize,
    /// Of photos of a captured room: the share of the region's pixels that do not count, 0 to 1, because they are clipped
    /// or the depth jumps beside them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<f64>,
    /// The value of each metric; those are left out for which no pixel or window counts.
    #[schemars(with = "BTreeMap<String, f64>")]
    pub values: BTreeMap<Metric, f64>,
    /// Of light: the standard error of the MSE due to noise of the paths of prediction and truth. The noise
    /// of R, which `scorer.json` states, is not in it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mse_error: Option<f64>,
    /// The MSE was exactly zero, and its PSNR is the cap.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub exact: bool,
    /// Of light: the error may be noise alone; the PSNR is that of 1.645 standard errors of the MSE.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lower_bound: bool,
}

/// Numbers that could not be computed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MissingMetric {
    /// The metric, or the kind of picture.
    pub metric: MissingNumbers,
    /// Why.
    pub reason: String,
    /// The command that makes it available.
    pub fix: String,
}

/// The numbers that are missing: all of one metric, or all of one kind of picture. A single word in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum MissingNumbers {
    Metric(Metric),
    Picture(PictureKind),
}

impl std::fmt::Display for MissingNumbers {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Metric(metric) => metric.fmt(f),
            Self::Picture(kind) => kind.fmt(f),
        }
    }
}

impl std::str::FromStr for MissingNumbers {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        word.parse().map(Self::Metric).or_else(|_| word.parse().map(Self::Picture))
    }
}

by_text!(MissingNumbers, UnknownWord, "^[a-z0-9_]+$");

impl PictureValues {
    /// A picture without values yet.
    pub fn new(scene: SceneId, view: ViewId, picture: PictureName, region: Region, pixels: usize) -> Self {
        Self {
            scene,
            view,
            picture,
            lighting: None,
            region,
            pixels,
            left_out: None,
            values: BTreeMap::new(),
            mse_error: None,
            exact: false,
            lower_bound: false,
        }
    }

    /// The mean that one of its values counts for.
    pub fn key(&self, metric: Metric) -> ResultKey {
        ResultKey { picture: self.picture, views: Views::of(&self.view, self.region), metric }
    }
}
