//! The explanation of one scene, as `mateval eval explain --format json` prints it.

use mateval_dataset::{Finding, InstanceId, SceneId, ViewId};
use mateval_eval::metric::PictureKind;
use mateval_eval::result::key::Views;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The format of this version of explanations.
pub const EXPLAIN_FORMAT: &str = "mateval-explain/2";

/// Where and how the albedo of a submission errs in one scene. Errors are mean squared errors of linear values, over
/// channels and over the valid pixels of all scored views that show an instance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExplainFile {
    /// Always `mateval-explain/2`.
    pub format: String,
    /// The tool that wrote it, as in `mateval 0.1.0`.
    pub tool: String,
    /// The method's name.
    pub method: String,
    /// Hash of the submission, on which the result and the submission agree.
    pub submission_sha256: String,
    /// SHA-256 of the dataset's manifest, hex.
    pub dataset_manifest_sha256: String,
    /// The protocol of the result that was explained.
    pub protocol: String,
    /// Its fingerprint.
    pub fingerprint: String,
    /// The scene.
    pub scene: SceneId,
    /// The scored views, in the scene's order.
    pub views: Vec<ViewId>,
    /// The number of compared pixels in all views.
    pub pixels: usize,
    /// Those among them that show surfaces which the photo does not show.
    pub unobserved_pixels: usize,
    /// Mean over those pixels.
    pub mse: f64,
    /// PSNR of that mean, in dB.
    pub psnr: f64,
    /// Shares of the whole scene's error; null if there is no error.
    pub kinds: Option<KindShares>,
    /// Every instance with compared pixels, the one with the largest share first.
    pub instances: Vec<InstanceExplanation>,
    /// Scores after scaling alone.
    pub alignments: Vec<AlignmentScores>,
    /// The worst instances under each light for which the result has errors of instances, at most ten for each, the
    /// worst first.
    pub light: Vec<LightShare>,
    /// The result's findings about the submission in this scene.
    pub findings: Vec<Finding>,
}

/// Shares of the squared error by kind, which add up to 1. The error in unobserved pixels comes first. Each step then
/// removes its share from the error that the steps before it leave in the other pixels. The shares therefore depend on
/// the order of the steps, which is the order of these keys.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KindShares {
    /// The error in pixels that show surfaces which the photo does not show.
    pub unobserved: f64,
    /// Removed by one scale for all channels of an instance: wrong brightness.
    pub scale: f64,
    /// Removed by one scale for each channel of an instance: wrong tint.
    pub chroma: f64,
    /// Removed by a factor that is a quadratic polynomial of the pixel's position, in each view of an instance: shading
    /// left in the albedo, or another smooth change of brightness that the truth has and the prediction lacks.
    pub shading: f64,
    /// Removed by moving the prediction by up to 4 whole pixels along either axis, in each view of an instance.
    pub misplacement: f64,
    /// Removed by adding a share of the truth's own detail to an instance: detail that the prediction lacks, as after
    /// blur.
    pub detail: f64,
    /// Removed by none of the steps.
    pub rest: f64,
}

/// One instance's error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstanceExplanation {
    /// The instance.
    pub instance: InstanceId,
    /// Its category, if the source states one.
    pub category: Option<String>,
    /// Its broader category, if the source states one.
    pub super_category: Option<String>,
    /// Its pixels in all views.
    pub pixels: usize,
    /// Mean over those.
    pub mse: f64,
    /// Its share of the scene's squared error, 0 to 1.
    pub share: f64,
    /// Shares of its error; null if it has none.
    pub kinds: Option<KindShares>,
    /// The factor that brings the prediction nearest to the truth; 1 if the prediction is black.
    pub scale: f64,
    /// For each channel, the factor that does so after `scale`; 1 if the channel is black.
    pub channel_scales: [f64; 3],
    /// The views in which the prediction was moved.
    pub shifts: Vec<ViewShift>,
    /// Standard deviation, in pixels, of the blur that best explains the missing detail; null if none is missing.
    pub blur_sigma_pixels: Option<f64>,
}

/// How far an instance was moved in one view.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewShift {
    /// The view.
    pub view: ViewId,
    /// Pixels to the right and down.
    pub pixels: [i32; 2],
}

/// The scores after scaling: means over the scene's pictures, in the protocol's albedo space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AlignmentScores {
    /// What has scales of its own.
    pub scales: AlignedBy,
    /// `input`, `novel` or `unobserved`.
    pub views: Views,
    /// Mean over pictures.
    pub mse: f64,
    /// Mean of the pictures' PSNR, in dB.
    pub psnr: f64,
}

/// What has scales of its own. The scales minimise the squared error of linear values over the valid pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AlignedBy {
    /// Nothing: `albedo` of the result.
    None,
    /// Every picture and channel: `albedo_aligned` of the result.
    PictureAndChannel,
    /// The scene: one scale for all views and channels.
    Scene,
    /// Every channel of the scene.
    SceneAndChannel,
    /// Every instance, for all views and channels.
    Instance,
    /// Every channel of every instance.
    InstanceAndChannel,
}

/// One instance's error under one light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightShare {
    /// `rgb_true` or `rgb_fitted`.
    pub picture: PictureKind,
    /// The instance.
    pub instance: InstanceId,
    /// Its category.
    pub category: Option<String>,
    /// Its pixels in the input view and the novel ones.
    pub pixels: usize,
    /// Mean squared error over those, from the result: of sRGB-encoded pictures, with render noise removed.
    pub mse: f64,
    /// Its share of the scene's squared error. Single errors can be below 0, since noise is removed only on average.
    pub share: f64,
}
