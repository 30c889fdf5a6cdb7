//! The 8-bit preview of a picture of light, which people look at.

use std::path::Path;

use mateval_image::{LinearRgb, Picture, png_io};

use crate::error::PrepError;

/// Writes `rgb.png` in `folder`: linear radiance times exposure, clipped to 0..1, sRGB.
pub(crate) fn write(folder: &Path, radiance: &Picture<LinearRgb>, exposure: f64) -> Result<(), PrepError> {
    let exposed = radiance.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (f64::from(v) * exposure) as f32)));
    Ok(png_io::write_srgb(&folder.join("rgb.png"), &exposed.to_srgb())?)
}
