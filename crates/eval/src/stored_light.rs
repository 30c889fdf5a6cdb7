//! Pictures of light as they wait in memory and on disk: multiplied by the exposure, in half floats.

use half::f16;
use mateval_image::{LinearRgb, Picture};

/// A picture of light, linear, multiplied by the scene's exposure, so that 1 is display white and half floats resolve what
/// a display shows to a two-thousandth. Values beyond 65504 times white become that.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StoredLight(Picture<[f16; 3]>);

/// The largest finite half float.
const MOST: f64 = 65504.0;

impl StoredLight {
    /// Stores radiances.
    pub(crate) fn exposed(radiance: &Picture<LinearRgb>, exposure: f64) -> Self {
        Self(radiance.map(|LinearRgb(rgb)| rgb.map(|v| stored(f64::from(v) * exposure))))
    }

    /// Stores exposed values, each computed from the index of its pixel.
    pub(crate) fn from_pixels(width: usize, height: usize, value: impl Fn(usize) -> [f64; 3]) -> Self {
        Self(Picture::from_fn(width, height, |x, y| value(y * width + x).map(stored)))
    }

    /// Width and height.
    pub(crate) fn size(&self) -> (usize, usize) {
        (self.0.width(), self.0.height())
    }

    /// The exposed value of the pixel with this index.
    pub(crate) fn at(&self, index: usize) -> [f64; 3] {
        self.0.pixels()[index].map(f64::from)
    }

    /// The exposed picture.
    pub(crate) fn picture(&self) -> Picture<LinearRgb> {
        self.0.map(|rgb| LinearRgb(rgb.map(f32::from)))
    }
}

fn stored(value: f64) -> f16 {
    f16::from_f64(value.clamp(-MOST, MOST))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_eleven_bits_and_stay_finite() {
        let picture = Picture::filled(2, 1, LinearRgb([0.3, 1e9, -0.125]));
        let stored = StoredLight::exposed(&picture, 2.0);
        let [r, g, b] = stored.at(1);
        assert!((r / 0.6 - 1.0).abs() < 1.0 / 2048.0 && g == MOST && b == -0.25);
        assert_eq!(stored.picture().get(0, 0).0, [r, g, b].map(|v| v as f32));
    }
}
