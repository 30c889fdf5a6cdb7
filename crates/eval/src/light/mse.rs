//! The mean squared error of a render, free of its noise, and the standard error of that.
//!
//! Noise of few samples adds its variance to a squared error. Two independent halves avoid that: with X and Y the
//! encoded difference of either half from the reference ([`super::difference`]), the expectation of the mean of X*Y is
//! the squared true difference, whatever the noise of the paths, as far as the pivot is right. Each half consists of
//! two quarters. Half of their difference, encoded as X (or Y) is, has the half's noise and nothing else: u (or v), of
//! the same variance as the noise of X, independent of Y. Pixels whose noise is correlated form a block
//! ([`noise_blocks`](mateval_tracer::shared_centre::noise_blocks)).
//!
//! ```text
//! S = sum over blocks of (Σ Y u)² + (Σ X v)²,   P = sum over blocks of (Σ u v)²
//! variance of Σ X Y = max(S - P, S / 2)
//! ```
//!
//! With X = d + x and Y = d + y, X*Y - d² = d (x + y) + x y, and the expectation of S - P is the variance, whatever the
//! distribution of the noise, if quarters are independent: of the squares d x, d y and x y that make the variance, S
//! counts x y twice, P takes it away once. Where few large contributions make the difference small or negative, S / 2
//! counts, which in expectation is at least half of the variance. Three effects are left out, being small where they
//! were measured (`benches/spread.rs`): the halves share a little through the pivot of the other half, the filter that
//! makes it reaches beyond a block, and R has noise of its own, which both halves have in common (`variance` in
//! `scorer.json` states it).

use std::collections::BTreeMap;
use std::f64::consts::LN_10;

use mateval_image::{Mask, Picture};
use mateval_metrics::{MetricError, Psnr};

use crate::light::difference::LightDifference;

/// A Gaussian value exceeds its mean by more than this many standard deviations in 5 % of all cases.
pub const ONE_SIDED_95: f64 = 1.645;

/// An estimate of the mean squared error without noise, over some pixels of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct LightMse {
    /// The estimate. It may be negative where the true value is near 0.
    pub mse: f64,
    /// The estimate's noise by block id, ascending, for the blocks with pixels that count.
    pub blocks: Vec<(u64, BlockSums)>,
    /// One sample of an error that all pixels of all views have in common, as that of lights which were fitted to noisy
    /// pictures: its square is an estimate of its variance.
    pub common: f64,
}

/// Σ Y u, Σ X v and Σ u v over one block, each divided by the number of all values that count. Their unit is that of
/// the MSE.
pub type BlockSums = [f64; 3];

fn variance<'a>(blocks: impl Iterator<Item = &'a BlockSums>, common: f64) -> f64 {
    let (mut squares, mut products) = (0.0, 0.0);
    for [yu, xv, uv] in blocks {
        squares += yu.powi(2) + xv.powi(2);
        products += uv.powi(2);
    }
    (squares - products).max(squares / 2.0) + common.powi(2)
}

impl LightMse {
    /// The error over the pixels of the mask and their channels; absent if no pixel counts. `block_ids` holds the
    /// block of each pixel. One block may occur in several views ([`mean_psnr_error`]). Fails where a value is not
    /// finite.
    pub fn new(
        difference: &LightDifference,
        mask: &Mask,
        block_ids: &Picture<u64>,
    ) -> Result<Option<Self>, MetricError> {
        let LightDifference { halves: [first, second], noise: [u, v], .. } = difference;
        let (mut sum, mut values) = (0.0, 0_usize);
        let mut by_block: BTreeMap<u64, BlockSums> = BTreeMap::new();
        for (at, block) in block_ids.pixels().iter().enumerate().filter(|&(at, _)| mask.pixels()[at]) {
            let noise = by_block.entry(*block).or_default();
            for c in 0..3 {
                let [x, y, u, v] = [first, second, u, v].map(|picture| f64::from(picture.pixels()[at].0[c]));
                sum += x * y;
                noise.iter_mut().zip([y * u, x * v, u * v]).for_each(|(sum, product)| *sum += product);
                values += 1;
            }
        }
        if values == 0 {
            return Ok(None);
        }
        let share = 1.0 / values as f64;
        let mse = sum * share;
        if !mse.is_finite() {
            return Err(MetricError::InvalidMse { mse });
        }
        let blocks = by_block.into_iter().map(|(block, sums)| (block, sums.map(|sum| share * sum))).collect();
        Ok(Some(Self { mse, blocks, common: 0.0 }))
    }

    /// The standard error of `mse`.
    pub fn standard_error(&self) -> f64 {
        variance(self.blocks.iter().map(|(_, noise)| noise), self.common).sqrt()
    }

    /// The MSE that its PSNR is of: `mse`, or 1.645 standard errors where that is more.
    pub fn bounded(&self) -> f64 {
        self.mse.max(ONE_SIDED_95 * self.standard_error())
    }

    /// Whether the error may be noise alone, so that the PSNR is a lower bound.
    pub fn is_lower_bound(&self) -> bool {
        self.mse < self.bounded()
    }

    /// The PSNR of [`Self::bounded`], which is continuous in `mse` and never rises with it. It is exact where neither
    /// error nor noise is left.
    pub fn psnr(&self) -> Result<Psnr, MetricError> {
        Psnr::from_mse(self.bounded())
    }
}

/// The standard error of the mean PSNR of several views, in dB; absent without views. Callers state it only where no
/// view's error may be noise alone.
///
/// To first order, dPSNR = -10 / ln 10 * dMSE / MSE; an exact view adds nothing. A block's effects on all views are
/// summed before they are squared, so that correlation between views counts.
pub fn mean_psnr_error(views: &[LightMse]) -> Option<f64> {
    let (mut by_block, mut common): (BTreeMap<u64, BlockSums>, f64) = Default::default();
    for view in views.iter().filter(|view| view.bounded() > 0.0) {
        let slope = -10.0 / LN_10 / view.bounded() / views.len() as f64;
        common += slope * view.common;
        for (block, noise) in &view.blocks {
            by_block.entry(*block).or_default().iter_mut().zip(noise).for_each(|(sum, noise)| *sum += slope * noise);
        }
    }
    (!views.is_empty()).then(|| variance(by_block.values(), common).sqrt())
}

#[cfg(test)]
mod tests {
    use mateval_image::SrgbRgb;

    use super::*;

    fn greys(values: [f32; 2]) -> Picture<SrgbRgb> {
        Picture::from_fn(2, 1, |x, _| SrgbRgb([values[x]; 3]))
    }

    fn error(mask: [bool; 2], blocks: [u64; 2]) -> Option<LightMse> {
        let difference = LightDifference {
            halves: [greys([0.5, 0.25]), greys([0.25, 0.25])],
            noise: [greys([0.125, 0.0]), greys([0.25, 0.125])],
            shown: greys([0.0; 2]),
        };
        let (mask, blocks) = (Picture::from_fn(2, 1, |x, _| mask[x]), Picture::from_fn(2, 1, |x, _| blocks[x]));
        LightMse::new(&difference, &mask, &blocks).unwrap()
    }

    /// X Y = (0.125, 0.0625); Y u = (0.03125, 0), X v = (0.125, 0.03125), u v = (0.03125, 0). All sums are divided by
    /// 2.
    #[test]
    fn a_small_number_by_hand() {
        let found = error([true, true], [7, 3]).unwrap();
        assert_eq!(found.mse, 0.09375);
        assert_eq!(found.blocks, [(3, [0.0, 0.015625, 0.0]), (7, [0.015625, 0.0625, 0.015625])]);
        let paths = 0.015625_f64.powi(2) + 0.0625_f64.powi(2);
        assert!((found.standard_error() - paths.sqrt()).abs() < 1e-15);
        // In one block, effects are added before they are squared.
        let together = error([true, true], [1, 1]).unwrap();
        let squares = 0.015625_f64.powi(2) + 0.078125_f64.powi(2);
        assert!((together.standard_error() - (squares - 0.015625_f64.powi(2)).sqrt()).abs() < 1e-15);
        assert_eq!(error([false, true], [7, 3]).unwrap().mse, 0.0625);
        assert_eq!(error([false, false], [7, 3]), None);
    }

    /// Two equal views whose paths are the same have the error of one; of different blocks, 1/√2 of it. An error that
    /// all have in common stays.
    #[test]
    fn views_that_share_paths_are_not_independent() {
        let one = error([true, true], [1, 1]).unwrap();
        let other = error([true, true], [2, 2]).unwrap();
        let single = mean_psnr_error(std::slice::from_ref(&one)).unwrap();
        let db = |views: &[LightMse]| mean_psnr_error(views).unwrap();
        assert!((db(&[one.clone(), one.clone()]) / single - 1.0).abs() < 1e-12);
        assert!((db(&[one.clone(), other]) / single - 0.5_f64.sqrt()).abs() < 1e-12);
        let fitted = LightMse { mse: 0.1, blocks: vec![(1, BlockSums::default())], common: 0.01 };
        assert!((db(&[fitted.clone(), fitted]) - 10.0 / LN_10 * 0.1).abs() < 1e-12);
        assert_eq!(mean_psnr_error(&[]), None);
    }

    #[test]
    fn what_is_under_the_noise_is_a_lower_bound() {
        let found = LightMse { mse: 1e-4, ..error([true, true], [1, 2]).unwrap() };
        assert!(found.is_lower_bound() && found.psnr().unwrap().db < 20.0);
        let exact = LightMse { mse: 0.0, blocks: vec![(1, BlockSums::default())], common: 0.0 };
        assert!(!exact.is_lower_bound() && exact.psnr().unwrap().exact);
        assert_eq!(mean_psnr_error(&[exact]), Some(0.0));
    }
}
