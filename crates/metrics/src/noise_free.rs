//! The mean squared error that renders would have without noise, and its standard error.
//!
//! Noise of few samples adds its variance to a squared error. Two independent halves of each picture avoid that: with
//! X = A - Ia and Y = B - Ib, the expectation of the mean of X*Y is the squared true difference d², whatever the noise.
//!
//! The noise of this estimate follows from the same halves. With X = d + x and Y = d + y, X*Y - d² = d (x + y) + x y,
//! and D = (X² - Y²) / 2 = d (x - y) + (x² - y²) / 2 has mean 0 and, for Gaussian noise that is alike in both halves,
//! the same covariances between any two pixels. Pixels whose noise is correlated form a block: D is summed within
//! blocks, and the variance of the mean is the sum of the squared sums. D = m (A - B) - m (Ia - Ib) with m = (X + Y) /
//! 2; its two uncorrelated parts are the prediction's noise and the reference's.
//!
//! Noise that is not Gaussian adds to the variance of D half its fourth cumulant (never negative for heavy tails) and
//! 2 d times its third; both vanish against the rest as the number of samples grows. With few samples of heavy-tailed
//! noise the standard error is therefore too large: where one sample in ten finds light, simulations gave 1.3 times the
//! true one at 4 samples and 1.1 at 16; where one in fifty does, 2.1 at 4, 1.5 at 16, 1.2 at 64. Two halves cannot
//! separate a fourth cumulant from a variance, so this is not corrected.

use std::collections::BTreeMap;
use std::f64::consts::LN_10;

use mateval_image::{Mask, Picture};

use crate::pixel::{Pixel, check_finite, check_size, size_of};
use crate::{MetricError, Psnr};

/// One picture rendered twice, with the same number of samples and different seeds.
#[derive(Clone, Copy, Debug)]
pub struct Halves<'a, P> {
    /// One half.
    pub a: &'a Picture<P>,
    /// The other half.
    pub b: &'a Picture<P>,
}

impl<P: Pixel> Halves<'_, P> {
    /// The pixel of both halves at an index of [`Picture::pixels`].
    pub(crate) fn at(&self, index: usize) -> [P; 2] {
        [self.a.pixels()[index], self.b.pixels()[index]]
    }
}

/// An estimate of the mean squared error without noise. Its unit is that of the values, squared.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseFreeMse {
    /// The estimate. It has no bias, so it may be negative where the true value is near 0.
    pub mse: f64,
    /// The number of pixels that count, at least 1.
    pub pixels: usize,
    /// The estimate's noise by block id, ascending, for the blocks with pixels that count.
    pub blocks: Vec<(u32, BlockNoise)>,
}

/// The noise that one block adds to a [`NoiseFreeMse`]: a random value of mean 0, whose square estimates the block's
/// part of the variance. Its unit is that of the MSE.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockNoise {
    /// From the prediction's noise: the block's sum of m (A - B), divided by the number of all values that count.
    pub prediction: f64,
    /// From the reference's noise: the same with m (Ia - Ib).
    pub reference: f64,
}

impl BlockNoise {
    /// From both: the block's sum of D, divided likewise.
    pub fn total(&self) -> f64 {
        self.prediction - self.reference
    }
}

/// Estimates the mean squared error, over the pixels of the mask and their channels, of the noise-free pictures that
/// the halves are renders of.
///
/// Values are compared as given, in the colour space of their type; where a curve was applied to noisy pixels,
/// [`encoding_bias`](crate::encoding_bias()) estimates its effect. `blocks` holds the block id of each pixel: noise may
/// be correlated within a block, not between two blocks. One id may occur in several views ([`psnr_mean_error`]).
///
/// `None` where no pixel counts. Fails if sizes differ or a value inside the mask is not finite.
pub fn noise_free_mse<P: Pixel>(
    prediction: Halves<P>,
    reference: Halves<P>,
    mask: &Mask,
    blocks: &Picture<u32>,
) -> Result<Option<NoiseFreeMse>, MetricError> {
    check_halves(prediction, reference, mask, blocks)?;
    let (mut sum, mut pixels, mut values) = (0.0, 0, 0);
    let mut by_block: BTreeMap<u32, BlockNoise> = BTreeMap::new();
    for (index, block) in blocks.pixels().iter().enumerate().filter(|&(index, _)| mask.pixels()[index]) {
        let ([a, b], [ia, ib]) = (prediction.at(index), reference.at(index));
        let noise = by_block.entry(*block).or_default();
        for channel in 0..a.channels().len() {
            let [a, b, ia, ib] = [a, b, ia, ib].map(|pixel| f64::from(pixel.channels()[channel]));
            let (x, y) = (a - ia, b - ib);
            let m = (x + y) / 2.0;
            sum += x * y;
            noise.prediction += m * (a - b);
            noise.reference += m * (ia - ib);
            values += 1;
        }
        pixels += 1;
    }
    let share = |sum: f64| sum / values as f64;
    let shared =
        |noise: BlockNoise| BlockNoise { prediction: share(noise.prediction), reference: share(noise.reference) };
    let blocks = by_block.into_iter().map(|(block, noise)| (block, shared(noise))).collect();
    Ok((pixels > 0).then(|| NoiseFreeMse { mse: share(sum), pixels, blocks }))
}

/// Checks all sizes first, then the values inside the mask.
pub(crate) fn check_halves<P: Pixel>(
    prediction: Halves<P>,
    reference: Halves<P>,
    mask: &Mask,
    blocks: &Picture<u32>,
) -> Result<(), MetricError> {
    let size = size_of(prediction.a);
    check_size(size, "prediction's second half", size_of(prediction.b))?;
    check_size(size, "reference's first half", size_of(reference.a))?;
    check_size(size, "reference's second half", size_of(reference.b))?;
    check_size(size, "mask", size_of(mask))?;
    check_size(size, "picture of blocks", size_of(blocks))?;
    check_finite("prediction's first half", prediction.a, Some(mask))?;
    check_finite("prediction's second half", prediction.b, Some(mask))?;
    check_finite("reference's first half", reference.a, Some(mask))?;
    check_finite("reference's second half", reference.b, Some(mask))
}

impl NoiseFreeMse {
    /// The standard deviation of `mse`, from the noise of prediction and reference.
    pub fn standard_error(&self) -> f64 {
        self.root_of_squares(|noise| noise.total())
    }

    /// The part of [`standard_error`](Self::standard_error) that more samples of the prediction lower.
    pub fn prediction_error(&self) -> f64 {
        self.root_of_squares(|noise| noise.prediction)
    }

    /// The part of [`standard_error`](Self::standard_error) that comes from the reference.
    pub fn reference_error(&self) -> f64 {
        self.root_of_squares(|noise| noise.reference)
    }

    fn root_of_squares(&self, part: impl Fn(&BlockNoise) -> f64) -> f64 {
        self.blocks.iter().map(|(_, noise)| part(noise).powi(2)).sum::<f64>().sqrt()
    }

    /// The PSNR, or its lower bound where `mse` is not significantly above 0. Fails if `mse` or the noise is not
    /// finite.
    pub fn psnr(&self) -> Result<NoiseFreePsnr, MetricError> {
        let reach = ONE_SIDED_95 * self.standard_error();
        if !(self.mse.is_finite() && reach.is_finite()) {
            return Err(MetricError::InvalidMse { mse: self.mse });
        }
        if self.mse == 0.0 && reach == 0.0 || self.mse > reach {
            let Psnr { db, exact } = Psnr::from_mse(self.mse)?;
            return Ok(NoiseFreePsnr { db, exact, lower_bound: false });
        }
        // A negative estimate shows that the noise is at least as large; the bound never falls below the reach.
        let bound = if self.mse > 0.0 { self.mse + reach } else { reach.max(-self.mse) };
        Ok(NoiseFreePsnr { db: Psnr::from_mse(bound)?.db, exact: false, lower_bound: true })
    }
}

/// A Gaussian value exceeds its mean by more than this many standard deviations in 5 % of all cases.
pub const ONE_SIDED_95: f64 = 1.645;

/// The PSNR of a [`NoiseFreeMse`], capped at [`Psnr::CAP_DB`] as [`Psnr`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseFreePsnr {
    /// Decibels.
    pub db: f64,
    /// The MSE was 0 and had no noise.
    pub exact: bool,
    /// The MSE was at most 1.645 standard errors and so may be 0. `db` is then the PSNR of the MSE's one-sided 95 %
    /// upper bound, which is mse + 1.645 standard errors, or for a negative estimate the larger of 1.645 standard
    /// errors and its absolute value. The true PSNR is probably higher.
    pub lower_bound: bool,
}

/// The standard error of a mean of PSNRs, decibels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoisePsnr {
    /// From all noise.
    pub total: f64,
    /// From the predictions' noise.
    pub prediction: f64,
    /// From the references' noise.
    pub reference: f64,
}

/// The standard error of the mean PSNR of several views, decibels.
///
/// To first order, dPSNR = -10 / ln 10 * dMSE / MSE. A block's effects on all views are summed before they are squared,
/// so that correlation between views counts. `None` without views or where an MSE is not above 0.
pub fn psnr_mean_error(views: &[&NoiseFreeMse]) -> Option<NoisePsnr> {
    if views.is_empty() || !views.iter().all(|view| view.mse > 0.0) {
        return None;
    }
    let mut by_block: BTreeMap<u32, BlockNoise> = BTreeMap::new();
    for view in views {
        let slope = -10.0 / LN_10 / view.mse / views.len() as f64;
        for (block, noise) in &view.blocks {
            let sum = by_block.entry(*block).or_default();
            sum.prediction += slope * noise.prediction;
            sum.reference += slope * noise.reference;
        }
    }
    let root = |part: fn(&BlockNoise) -> f64| by_block.values().map(|noise| part(noise).powi(2)).sum::<f64>().sqrt();
    Some(NoisePsnr {
        total: root(BlockNoise::total),
        prediction: root(|noise| noise.prediction),
        reference: root(|noise| noise.reference),
    })
}

#[cfg(test)]
mod tests;
