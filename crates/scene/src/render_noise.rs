//! How noisy a render is, measured from its two halves.

use mateval_image::{LinearRgb, Picture};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How noisy a picture is: means over all pixels and channels, linear, before exposure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderNoise {
    /// Mean of ((a - b) / 2)²: the expected squared error of the plain mean of both halves.
    pub mean_of_halves_mse: f64,
    /// Mean of (rgb - a) (rgb - b): the squared error of the denoised picture, without the noise of the halves, so that it
    /// may be slightly below 0.
    pub denoised_mse: f64,
}

impl RenderNoise {
    /// Measures the noise of two halves and of the picture denoised from their mean.
    pub fn of([a, b]: [&Picture<LinearRgb>; 2], denoised: &Picture<LinearRgb>) -> Self {
        let halves = || values(a).zip(values(b));
        let squares = halves().map(|(a, b)| (a - b) * (a - b) / 4.0);
        let count = 3.0 * a.pixels().len() as f64;
        let products = values(denoised).zip(halves()).map(|(rgb, (a, b))| (rgb - a) * (rgb - b));
        Self { mean_of_halves_mse: squares.sum::<f64>() / count, denoised_mse: products.sum::<f64>() / count }
    }
}

fn values(picture: &Picture<LinearRgb>) -> impl Iterator<Item = f64> {
    picture.pixels().iter().flat_map(|pixel| pixel.0.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        let flat = |value: f32| Picture::filled(4, 3, LinearRgb([value; 3]));
        let noise = RenderNoise::of([&flat(1.0), &flat(3.0)], &flat(2.0));
        assert_eq!(noise, RenderNoise { mean_of_halves_mse: 1.0, denoised_mse: -1.0 });
        assert_eq!(RenderNoise::of([&flat(1.0), &flat(1.0)], &flat(1.5)).denoised_mse, 0.25);
    }
}
