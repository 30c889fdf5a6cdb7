//! Lightings whose truth is too noisy to be scored.
//!
//! Encoding a noisy value has a bias that its correction takes out to first order only. Where a weak lamp is exposed as
//! brightly as the photo and its pictures have few samples, the rest is so large that the true material does not score
//! best, and no standard error shows it. Such lightings are left out, for every submission alike.

use mateval_image::{LinearRgb, Mask};

use crate::relit::LightingName;
use crate::rgb::encode_noisy;
use crate::truth::TrueLight;

/// A lighting that is left out.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NoisyLighting {
    pub(crate) lighting: LightingName,
    /// The variance of its input view.
    pub(crate) variance: f64,
}

/// The variance that noise causes in the mean of both encoded halves: mean over the valid pixels and their channels; 0
/// without valid pixels.
pub(crate) fn encoded_variance(truth: &TrueLight, valid: &Mask) -> f64 {
    let (mut sum, mut values) = (0.0, 0_usize);
    for k in (0..valid.pixels().len()).filter(|&k| valid.pixels()[k]) {
        let [a, b] = [0, 1].map(|half| encode_noisy(LinearRgb(truth.halves[half].at(k).map(|v| v as f32))).0);
        sum += (0..3).map(|c| (f64::from(a[c] - b[c]) / 2.0).powi(2)).sum::<f64>();
        values += 3;
    }
    sum / values.max(1) as f64
}

#[cfg(test)]
mod tests {
    use mateval_image::Picture;

    use super::*;
    use crate::truth::RgbTruth;

    fn light(a: f32, b: f32) -> TrueLight {
        let flat = |v: f32| Picture::from_fn(2, 1, |x, _| LinearRgb([if x == 0 { v } else { 9.0 * v }; 3]));
        let truth = RgbTruth { halves: [flat(a), flat(b)], shown: flat((a + b) / 2.0) };
        TrueLight::new(&truth, 1.0)
    }

    /// 0.2140 and 0.0509 are encoded as 0.5 and 0.25: the mean's deviation is half of a quarter. Only valid pixels count,
    /// and where nothing is valid there is no noise.
    #[test]
    fn half_the_difference_of_the_halves_is_the_deviation() {
        let first = Mask::from_fn(2, 1, |x, _| x == 0);
        let found = encoded_variance(&light(0.214_041_14, 0.050_876_09), &first);
        assert!((found / 0.125_f64.powi(2) - 1.0).abs() < 2e-3, "{found}");
        assert_eq!(encoded_variance(&light(0.3, 0.3), &first), 0.0);
        assert_eq!(encoded_variance(&light(0.3, 0.1), &Mask::filled(2, 1, false)), 0.0);
    }
}
