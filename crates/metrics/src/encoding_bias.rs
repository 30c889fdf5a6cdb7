//! The bias that an encoding curve over noisy pixels adds to a noise-free mean squared error.
//!
//! Clipping to 0..1 and sRGB encoding do not commute with means: the expectation of an encoded half f(a) is not f(μ)
//! but f(μ) + b, with b = f''(μ) var(a) / 2 to first order. With b of the prediction minus b of the reference, the
//! expectation of [`noise_free_mse`](crate::noise_free_mse()) of encoded halves is (d + b)² instead of d². Its bias is
//! the mean of 2 d b + b².

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};

use crate::MetricError;
use crate::noise_free::{Halves, check_halves};

/// The difference between the [`NoiseFreeMse`](crate::NoiseFreeMse) of encoded halves and the mean squared error of the
/// encoded noise-free pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncodingBias {
    /// The difference (measured minus true), to first order in 1 / samples.
    pub estimate: f64,
    /// An upper bound of the difference's absolute value. It does not hold where most of the light comes from samples
    /// so rare that neither half has one.
    pub bound: f64,
}

/// The number of standard errors of the estimate that the bound includes.
pub const STANDARD_ERRORS: f64 = 3.0;
/// The share of the mean squared bias that the bound includes for terms of second order in 1 / samples. In simulations
/// of Gaussian and heavy-tailed noise at 4 to 256 samples, 0.7 sufficed.
pub const SECOND_ORDER: f64 = 1.0;

/// Estimates the bias of [`noise_free_mse`](crate::noise_free_mse()) over the mask when it is given halves that went
/// through `encode`. The halves given here are in linear light.
///
/// The bias of a half is about twice that of the halves' mean, so the jackknife (Quenouille 1956) estimates b as
/// f(a1) + f(a2) - 2 f((a1 + a2) / 2), for the prediction minus the same for the reference. The difference M of the encoded
/// means is about d + b / 2, hence 2 M b = 2 d b + b² without squaring a noisy value. The bound adds up the estimate's
/// absolute value, its own noise by `blocks` (as in [`noise_free_mse`](crate::noise_free_mse())), and the mean of both
/// squared biases for terms of higher order.
///
/// `encode` must treat each pixel alone. `None` where no pixel counts. Fails if sizes differ or a linear value inside
/// the mask is not finite.
pub fn encoding_bias(
    prediction: Halves<LinearRgb>,
    reference: Halves<LinearRgb>,
    encode: impl Fn(LinearRgb) -> SrgbRgb,
    mask: &Mask,
    blocks: &Picture<u32>,
) -> Result<Option<EncodingBias>, MetricError> {
    check_halves(prediction, reference, mask, blocks)?;
    let (mut estimates, mut squares, mut pixels) = (0.0, 0.0, 0);
    let mut by_block: BTreeMap<u32, (f64, usize)> = BTreeMap::new();
    for (index, block) in blocks.pixels().iter().enumerate().filter(|&(index, _)| mask.pixels()[index]) {
        let p = bias_of_half(prediction.at(index), &encode);
        let r = bias_of_half(reference.at(index), &encode);
        let estimate: f64 = (0..3).map(|c| 2.0 * (p[c].mean - r[c].mean) * (p[c].bias - r[c].bias)).sum();
        squares += (0..3).map(|c| p[c].bias.powi(2) + r[c].bias.powi(2)).sum::<f64>();
        estimates += estimate;
        pixels += 1;
        let (sum, count) = by_block.entry(*block).or_default();
        *sum += estimate;
        *count += 1;
    }
    let values = 3.0 * pixels as f64;
    let mean = estimates / pixels as f64;
    let variance: f64 = by_block.values().map(|&(sum, count)| (sum - mean * count as f64).powi(2)).sum();
    let estimate = estimates / values;
    let bound = estimate.abs() + STANDARD_ERRORS * variance.sqrt() / values + SECOND_ORDER * squares / values;
    Ok((pixels > 0).then_some(EncodingBias { estimate, bound }))
}

/// One channel of a pixel.
struct Encoded {
    /// The encoded mean of both halves.
    mean: f64,
    /// The expectation of an encoded half minus the encoded expectation, estimated.
    bias: f64,
}

fn bias_of_half([a, b]: [LinearRgb; 2], encode: impl Fn(LinearRgb) -> SrgbRgb) -> [Encoded; 3] {
    let mean = LinearRgb(std::array::from_fn(|c| 0.5 * (a.0[c] + b.0[c])));
    let [a, b, mean] = [a, b, mean].map(|linear| encode(linear).0.map(f64::from));
    std::array::from_fn(|c| Encoded { mean: mean[c], bias: a[c] + b[c] - 2.0 * mean[c] })
}

#[cfg(test)]
mod tests;
