//! The constancy of a result: how far a submission's answers to a scene and its twins lie apart.

use mateval_dataset::SceneId;
use mateval_dataset::lighting::LightingName;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::metric::HALF_A_BYTE;

/// The constancy of a submission's base colours in one family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Constancy {
    /// The scene that the family shows.
    pub scene: SceneId,
    /// The lightings of its twins.
    pub lightings: Vec<LightingName>,
    /// The area of the texels that the input view shows, in square metres.
    pub area_m2: f64,
    /// Of the base colours as they are.
    pub raw: Deviation,
    /// Of the base colours of each scene and twin after one scale a channel, which brings their mean to that of the
    /// family.
    pub aligned: Deviation,
    /// The mean squared error of the family's mean of raw base colours, linear, mean over channels.
    pub mean_mse: f64,
    /// The mean CIEDE2000 difference of the family's mean of raw base colours from the truth.
    pub mean_delta_e: f64,
}

/// How far the answers to a family lie from their mean. Root mean squares over texels, by area, and over the family.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deviation {
    /// Linear, also over channels.
    pub linear: f64,
    /// In CIEDE2000, of colours clipped to 0..1.
    pub delta_e: f64,
    /// Of the luminance.
    pub luminance: PartSpread,
    /// Of what remains of a colour without its luminance, also over channels.
    pub chroma: PartSpread,
    /// The deviations of luminance and of chroma, each divided by its contrast: their root mean square. Null where one
    /// of both contrasts is at most 0.505/255, which counts as none.
    pub relative: Option<f64>,
}

/// Of one part of the colours, linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartSpread {
    /// How far the answers to a family lie from their mean.
    pub deviation: f64,
    /// How far the texels of the family's mean lie from the mean of all its texels.
    pub contrast: f64,
}

impl Deviation {
    /// The value of [`Self::relative`].
    pub(crate) fn guarded(&self) -> Option<f64> {
        let has_contrast = [self.luminance, self.chroma].iter().all(|part| part.contrast > f64::from(HALF_A_BYTE));
        let square = |part: PartSpread| (part.deviation / part.contrast).powi(2);
        has_contrast.then(|| ((square(self.luminance) + square(self.chroma)) / 2.0).sqrt())
    }
}
