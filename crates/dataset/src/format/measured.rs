//! Colours that were measured on surfaces of a real room: the file that states them for `prep build`, and
//! `ground_truth/measured.json`, which scores are made from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ids::ViewId;

/// The format of a file of measurements.
pub const MEASUREMENTS_FORMAT: &str = "mateval-measurements/1";

/// Measured colours of regions of photos, as whoever measured them states them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasurementsFile {
    /// Always `mateval-measurements/1`.
    pub format: String,
    /// One entry for each region of each photo.
    pub regions: Vec<MeasuredArea>,
}

/// A region of a photo whose colour was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredArea {
    /// A name for messages, as in `left wall`.
    pub name: String,
    /// The photo, with or without its ending.
    pub photo: String,
    /// A picture of whole numbers at the photo's size, relative to this file's folder: an 8- or 16-bit grey PNG.
    pub mask: String,
    /// The number of the region's pixels in it; 0 is no region.
    #[schemars(range(min = 1))]
    pub value: u16,
    /// Linear Rec. 709 under D65, 0 to 1: the share of light that the surface reflects.
    pub color: [f64; 3],
    /// The standard error of the measurement, channel by channel; absent where nobody knows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_error: Option<[f64; 3]>,
}

/// `ground_truth/measured.json`: the measured regions of a captured scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredFile {
    /// Always `mateval/3`.
    pub format: String,
    /// In the order of their index.
    pub regions: Vec<MeasuredRegion>,
}

/// A measured region of a view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredRegion {
    /// Its name, from the measurements.
    pub name: String,
    /// The view whose `ground_truth/views/<view>/measured.png` shows it.
    pub view: ViewId,
    /// Its value in that picture.
    #[schemars(range(min = 1))]
    pub index: u16,
    /// Linear Rec. 709 under D65, 0 to 1.
    pub color: [f64; 3],
    /// The standard error of the measurement, channel by channel; absent where nobody knows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_error: Option<[f64; 3]>,
}

/// What is wrong with a measured colour and its error, if anything is.
pub fn color_fault(color: &[f64; 3], standard_error: Option<&[f64; 3]>) -> Option<String> {
    // Neither comparison holds of NaN.
    if !color.iter().all(|value| (0.0..=1.0).contains(value)) {
        return Some(format!("the colour is {color:?}; expected linear numbers of 0 to 1"));
    }
    let error = standard_error.filter(|error| !error.iter().all(|value| (0.0..=1.0).contains(value)))?;
    Some(format!("the standard error is {error:?}; expected linear numbers of 0 to 1"))
}
