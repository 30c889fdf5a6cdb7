//! The radiances that a fit found, as a result states them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Radiances fitted to the input view: the mean of two fits to independent streams of samples, each with the proof that no
/// other radiances fit better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedRadiances {
    /// Whether they belong to a light stage; otherwise they multiply the radiances of the scene's own emitters.
    pub stage: bool,
    /// The radiance of each light.
    pub lights: Vec<FittedRadiance>,
    /// Mean absolute difference of the averaged pictures, linear, for each channel; of both fits. Where the photo is clipped,
    /// only missing light counts.
    pub mean_absolute_error: [f64; 3],
    /// What the ridge adds to that error, mean of both fits.
    pub ridge: [f64; 3],
    /// Lower bound of their sum, mean of both fits: no other radiances can have less.
    pub lower_bound: [f64; 3],
}

/// One light's radiance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedRadiance {
    /// The light's name.
    pub light: String,
    /// Linear Rec. 709.
    pub radiance: [f64; 3],
    /// Half the difference between both fits: a sample of the noise of `radiance`.
    pub spread: [f64; 3],
}
