//! Type of the explanation that `mateval eval explain --format json` prints.

use mateval_eval::result_key::{PictureKind, Views};
use mateval_scene::{Finding, InstanceId, SceneId, ViewId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The word for this version of an explanation.
pub const EXPLAIN_FORMAT: &str = "mateval-explain/1";

/// Where a submission's albedo errs in one scene, and how. Errors are squared, linear, means over channels, over the valid
/// pixels of all scored views that show an instance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExplainFile {
    /// Always `mateval-explain/1`.
    pub format: String,
    /// What made it, as in `mateval 0.1.0`.
    pub tool: String,
    /// The method's name.
    pub method: String,
    /// The result's hash of the submission, which the submission was found to have.
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
    /// Pixels that count, in all views.
    pub pixels: usize,
    /// Mean over those pixels.
    pub mse: f64,
    /// Of that mean, in dB.
    pub psnr: f64,
    /// Of the whole scene; null where there is no error.
    pub kinds: Option<KindShares>,
    /// Every instance that counts, the one with the largest share first.
    pub instances: Vec<InstanceExplanation>,
    /// What scales alone would mend.
    pub alignments: Vec<AlignmentScores>,
    /// The worst instances of each track of light that the result has them of, ten of each at most, the worst first.
    pub light: Vec<LightShare>,
    /// What the result found wrong with the submission in this scene.
    pub findings: Vec<Finding>,
}

/// Shares of the squared error by kind, which add up to 1. Each is what its step takes away from what the steps before it
/// have left, so that shares depend on the steps' order: it is that of these keys.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KindShares {
    /// By one scale an instance, of all channels alike: its brightness.
    pub scale: f64,
    /// By one scale a channel and instance: its tint.
    pub chroma: f64,
    /// By a factor for each view of an instance that is a quadratic polynomial of the pixel's place: shading left in, or
    /// another smooth change of brightness that the truth has and the prediction lacks.
    pub shading: f64,
    /// By moving the prediction up to 4 whole pixels along either axis, in each view of an instance.
    pub misplacement: f64,
    /// By adding a share of the truth's own detail, which blur would have removed, to an instance.
    pub detail: f64,
    /// None of these.
    pub rest: f64,
}

/// One instance's error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstanceExplanation {
    /// The instance.
    pub instance: InstanceId,
    /// The source's category, where it says so.
    pub category: Option<String>,
    /// The source's broader category.
    pub super_category: Option<String>,
    /// Its pixels in all views.
    pub pixels: usize,
    /// Mean over those.
    pub mse: f64,
    /// Its share of the scene's squared error, 0 to 1.
    pub share: f64,
    /// Null where it has no error.
    pub kinds: Option<KindShares>,
    /// The factor that brings its albedo nearest to the truth's; 1 where all of it is black.
    pub scale: f64,
    /// The factors a channel that do so behind that one; 1 where a channel is black.
    pub channel_scales: [f64; 3],
    /// Where the prediction had to be moved.
    pub shifts: Vec<ViewShift>,
    /// Standard deviation, in pixels, of the blur whose loss the missing detail is most like; null where none is missing.
    pub blur_sigma_pixels: Option<f64>,
}

/// How far an instance was moved in one view.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewShift {
    /// The view.
    pub view: ViewId,
    /// To the right and down.
    pub pixels: [i32; 2],
}

/// What is left after scales of one kind: means over the scene's pictures, in the protocol's space of albedo.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AlignmentScores {
    /// What has a scale of its own.
    pub scales: AlignedBy,
    /// `input`, `novel`, `unobserved`.
    pub views: Views,
    /// Mean over pictures.
    pub mse: f64,
    /// Mean of the pictures' PSNR, in dB.
    pub psnr: f64,
}

/// What has a scale of its own. Scales are the best for the squared error in linear light over the valid pixels.
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
    /// Mean over those, as the result has it: of encoded pictures, free of noise.
    pub mse: f64,
    /// Of the scene's, which can hold terms below 0 too: noise is removed on average only.
    pub share: f64,
}
