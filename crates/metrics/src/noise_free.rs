//! The mean squared error of renders as if they had no noise, and how uncertain it is.
//!
//! A picture rendered with few samples is off by its noise, and its squared error by the noise's variance. Two
//! independent halves of each picture avoid that: with X = A - Ia and Y = B - Ib, the mean of X*Y has the expectation
//! of the squared true difference d², whatever the noise.
//!
//! Its own noise follows from the same halves. Where X = d + x and Y = d + y, X*Y - d² = d (x + y) + x y, and
//! D = (X² - Y²) / 2 = d (x - y) + (x² - y²) / 2 has mean 0 and, for Gaussian noise that is alike in both halves, the
//! same covariances between any two pixels. Pixels whose noise is correlated form a block: D is summed within blocks,
//! and the variance of the mean is the sum of the squared sums. D = m (A - B) - m (Ia - Ib) with m = (X + Y) / 2: its
//! two parts are uncorrelated, the prediction's noise and the reference's.
//!
//! Noise that is not Gaussian adds to the variance of D half its fourth cumulant (never negative for heavy tails) and
//! 2 d times its third; both fade against the rest with the number of samples. So at few samples of heavy-tailed
//! noise the standard error is rather too large: where one sample in ten finds light, simulations had 1.3 times the
//! true one at 4 samples and 1.1 at 16; where one in fifty does, 2.1 at 4, 1.5 at 16, 1.2 at 64. Two halves do not tell
//! a fourth cumulant from a variance, so this is not corrected.

use std::collections::BTreeMap;
use std::f64::consts::LN_10;

use mateval_image::{Mask, Picture};

use crate::MetricError;
use crate::Psnr;
use crate::pixel::{Pixel, check_finite, check_size, size_of};

/// One picture rendered twice, with as many samples but different seeds.
#[derive(Clone, Copy, Debug)]
pub struct Halves<'a, P> {
    /// One half.
    pub a: &'a Picture<P>,
    /// The other half.
    pub b: &'a Picture<P>,
}

impl<P: Pixel> Halves<'_, P> {
    /// The pixel of both halves, by its place in [`Picture::pixels`].
    pub(crate) fn at(&self, index: usize) -> [P; 2] {
        [self.a.pixels()[index], self.b.pixels()[index]]
    }
}

/// A mean squared error without the pictures' noise in it. Unit: that of the values, squared.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseFreeMse {
    /// The estimate. Its expectation is the true one, so it may be negative where that is near 0.
    pub mse: f64,
    /// How many pixels counted, at least 1.
    pub pixels: usize,
    /// The estimate's noise by block; ascending ids of the blocks that count.
    pub blocks: Vec<(u32, BlockNoise)>,
}

/// How far one block's noise may move a [`NoiseFreeMse`]: a random value of mean 0, whose square is what the block adds
/// to the variance. Unit: that of the MSE.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockNoise {
    /// By the prediction's noise: the block's sum of m (A - B), over the number of all values that count.
    pub prediction: f64,
    /// By the reference's noise: the same of m (Ia - Ib).
    pub reference: f64,
}

impl BlockNoise {
    /// By both: the block's sum of D.
    pub fn total(&self) -> f64 {
        self.prediction - self.reference
    }
}

/// The mean squared error of the pictures that the halves are noisy renders of, over the pixels of the mask and their
/// channels.
///
/// All pictures are of one size. Values are compared as given, in the colour space of their type; where a curve was
/// applied to noisy pixels, [`encoding_bias`](crate::encoding_bias()) tells what that does. `blocks` tells for each
/// pixel the id of its block: noise may be correlated within a block, not between two. One id may occur in several
/// views ([`psnr_mean_error`]).
///
/// `None` where no pixel counts. Fails if sizes differ or a value that counts is not finite.
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

/// Sizes first, then values that count.
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
    /// The standard deviation of `mse`, from the noise of both.
    pub fn standard_error(&self) -> f64 {
        self.root_of_squares(|noise| noise.total())
    }

    /// The part of [`standard_error`](Self::standard_error) that is the prediction's; more samples of it lower it.
    pub fn prediction_error(&self) -> f64 {
        self.root_of_squares(|noise| noise.prediction)
    }

    /// The part that is the reference's, which no sample of the prediction lowers.
    pub fn reference_error(&self) -> f64 {
        self.root_of_squares(|noise| noise.reference)
    }

    fn root_of_squares(&self, part: impl Fn(&BlockNoise) -> f64) -> f64 {
        self.blocks.iter().map(|(_, noise)| part(noise).powi(2)).sum::<f64>().sqrt()
    }

    /// The PSNR, or its lower bound where `mse` is not surely above 0. Fails if `mse` or the noise is not finite.
    pub fn psnr(&self) -> Result<NoiseFreePsnr, MetricError> {
        let reach = ONE_SIDED_95 * self.standard_error();
        if !(self.mse.is_finite() && reach.is_finite()) {
            return Err(MetricError::InvalidMse { mse: self.mse });
        }
        if self.mse == 0.0 && reach == 0.0 || self.mse > reach {
            let Psnr { db, exact } = Psnr::from_mse(self.mse)?;
            return Ok(NoiseFreePsnr { db, exact, lower_bound: false });
        }
        // A negative estimate shows that the noise is at least as large as it; the bound never falls below the reach.
        let bound = if self.mse > 0.0 { self.mse + reach } else { reach.max(-self.mse) };
        Ok(NoiseFreePsnr { db: Psnr::from_mse(bound)?.db, exact: false, lower_bound: true })
    }
}

/// Standard deviations that a Gaussian value exceeds on one side in 5 % of all cases.
const ONE_SIDED_95: f64 = 1.645;

/// The PSNR of a [`NoiseFreeMse`], capped at [`Psnr::CAP_DB`] as [`Psnr`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseFreePsnr {
    /// Decibels.
    pub db: f64,
    /// The MSE was 0, and without noise.
    pub exact: bool,
    /// The MSE was at most 1.645 standard errors, so that it may as well be 0: `db` is the PSNR of the MSE's one-sided
    /// 95 % upper bound, mse + 1.645 standard errors (of a negative estimate: the larger of 1.645 standard errors and
    /// its absolute value), and the true PSNR is probably higher.
    pub lower_bound: bool,
}

/// The standard error of a mean of PSNRs, decibels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoisePsnr {
    /// By all noise.
    pub total: f64,
    /// By the predictions' noise.
    pub prediction: f64,
    /// By the references' noise.
    pub reference: f64,
}

/// The standard error of the mean PSNR of several views, decibels.
///
/// To first order, dPSNR = -10 / ln 10 * dMSE / MSE. What one block does to all views that it occurs in is summed
/// before it is squared, so correlation between views counts. `None` without views or where an MSE is not above 0.
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
