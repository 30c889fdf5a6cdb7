//! The mean squared error that renders would have without noise, and its standard error.
//!
//! Noise of few samples adds its variance to a squared error. Two independent halves of each picture avoid that: with
//! X = A - Ia and Y = B - Ib, the expectation of the mean of X*Y is the squared true difference d², whatever the noise.
//!
//! The noise of this estimate follows from the same pictures, for sources that are independent of each other:
//!
//! - The prediction's paths. Each half comes in quarters ([`NoisyRender`]), whose difference u (of A) or v (of B) has the
//!   half's noise and nothing else. With X = d + x and Y = d + y, X*Y - d² = d (x + y) + x y. The expectation of
//!   (Σ Y u)² + (Σ X v)² - (Σ u v)² is the variance of Σ X*Y as far as it comes from those paths, without any assumption about the
//!   distribution of the noise beyond the independence of quarters. Where few large contributions make it small or negative,
//!   half of the first two terms counts, whose expectation is at least half of the variance. Two halves alone could not
//!   separate a fourth cumulant from a variance.
//! - The reference, of which there are two halves only: with m = (X + Y) / 2, the square of Σ m (Ia - Ib) less the square
//!   of Σ (u + v) / 2 (Ia - Ib), which the paths' noise in m adds. It assumes Gaussian noise, which a reference of many
//!   samples has.
//! - Noise that both quarters of a half share ([`NoisyRender::shared`]), like the reference's.
//! - An error that all pixels have in common ([`NoiseFreeMse::common`]), as that of lights which were fitted to noisy
//!   pictures. Only the caller can know it.
//!
//! Pixels whose noise is correlated form a block: all sums are taken within blocks, and variances are added over them.

use std::collections::BTreeMap;
use std::f64::consts::LN_10;

use mateval_image::{Mask, Picture};

use crate::pixel::{Pixel, check_finite, check_size, size_of};
use crate::{Halves, MetricError, NoisyRender, Psnr};

/// An estimate of the mean squared error without noise. Its unit is that of the values, squared.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseFreeMse {
    /// The estimate. It has no bias, so it may be negative where the true value is near 0.
    pub mse: f64,
    /// The number of pixels that count, at least 1.
    pub pixels: usize,
    /// The estimate's noise by block id, ascending, for the blocks with pixels that count.
    pub blocks: Vec<(u32, BlockNoise)>,
    /// One sample of an error that all pixels of all views have in common: its square is an estimate of its variance.
    /// [`noise_free_mse`] sets 0.
    pub common: f64,
}

/// Sums over one block from which the noise that it adds to a [`NoiseFreeMse`] follows, each divided by the number of all
/// values that count. Their unit is that of the MSE.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockNoise {
    /// Σ Y u.
    pub first_half: f64,
    /// Σ X v.
    pub second_half: f64,
    /// Σ u v.
    pub both_halves: f64,
    /// Σ m (Ia - Ib).
    pub reference: f64,
    /// Σ (u + v) / 2 (Ia - Ib).
    pub paths_in_reference: f64,
    /// Σ m s, where s is the shared noise of the first half minus that of the second.
    pub shared: f64,
    /// Σ (u + v) / 2 s.
    pub paths_in_shared: f64,
}

/// Variances of an estimate by the source of the noise. That of the paths is at least half of its positive terms; another
/// source whose estimated variance is negative has 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Variances {
    /// From the prediction's paths, which more samples lower.
    pub paths: f64,
    /// The part of [`Self::paths`] that comes from products of both halves' noise: it falls with the square of the number of
    /// samples, the rest in proportion.
    pub products: f64,
    /// From the noise that the quarters of a half share.
    pub shared: f64,
    /// From the reference.
    pub reference: f64,
    /// From the error that all pixels have in common.
    pub common: f64,
}

impl BlockNoise {
    fn add_scaled(&mut self, factor: f64, other: &Self) {
        self.first_half += factor * other.first_half;
        self.second_half += factor * other.second_half;
        self.both_halves += factor * other.both_halves;
        self.reference += factor * other.reference;
        self.paths_in_reference += factor * other.paths_in_reference;
        self.shared += factor * other.shared;
        self.paths_in_shared += factor * other.paths_in_shared;
    }
}

impl Variances {
    fn of<'a>(blocks: impl Iterator<Item = &'a BlockNoise>, common: f64) -> Self {
        let (mut sum, mut squares) = (Self { common: common.powi(2), ..Self::default() }, 0.0);
        for block in blocks {
            squares += block.first_half.powi(2) + block.second_half.powi(2);
            sum.products += block.both_halves.powi(2);
            sum.shared += block.shared.powi(2) - block.paths_in_shared.powi(2);
            sum.reference += block.reference.powi(2) - block.paths_in_reference.powi(2);
        }
        let Self { products, shared, reference, common, .. } = sum;
        let paths = (squares - products).max(squares / 2.0);
        Self { paths, products: products.min(paths), shared: shared.max(0.0), reference: reference.max(0.0), common }
    }

    /// From all sources.
    pub fn total(&self) -> f64 {
        self.paths + self.shared + self.reference + self.common
    }
}

/// Estimates the mean squared error, over the pixels of the mask and their channels, of the noise-free pictures that
/// the prediction and the reference's halves are renders of.
///
/// Values are compared as given, in the colour space of their type. `blocks` holds the block id of each pixel: noise may
/// be correlated within a block, not between two blocks. One id may occur in several views ([`psnr_mean_error`]).
///
/// `None` where no pixel counts. Fails if sizes differ or a value inside the mask is not finite.
pub fn noise_free_mse<P: Pixel>(
    prediction: &NoisyRender<P>,
    reference: Halves<P>,
    mask: &Mask,
    blocks: &Picture<u32>,
) -> Result<Option<NoiseFreeMse>, MetricError> {
    check(prediction, reference, mask, blocks)?;
    let (mut sum, mut pixels, mut values) = (0.0, 0_usize, 0_usize);
    let mut by_block: BTreeMap<u32, BlockNoise> = BTreeMap::new();
    for (index, block) in blocks.pixels().iter().enumerate().filter(|&(index, _)| mask.pixels()[index]) {
        let pixel = |picture: &Picture<P>| picture.pixels()[index];
        let NoisyRender { a, b, shared } = prediction;
        let all = [&a.estimate, &b.estimate, reference.a, reference.b, &a.noise, &b.noise].map(pixel);
        let shared = shared.as_ref().map(pixel).unwrap_or_default();
        let noise = by_block.entry(*block).or_default();
        for channel in 0..shared.channels().len() {
            let [a, b, ia, ib, u, v] = all.map(|pixel| f64::from(pixel.channels()[channel]));
            let (x, y, s) = (a - ia, b - ib, f64::from(shared.channels()[channel]));
            let (m, w) = ((x + y) / 2.0, (u + v) / 2.0);
            sum += x * y;
            noise.first_half += y * u;
            noise.second_half += x * v;
            noise.both_halves += u * v;
            noise.reference += m * (ia - ib);
            noise.paths_in_reference += w * (ia - ib);
            noise.shared += m * s;
            noise.paths_in_shared += w * s;
            values += 1;
        }
        pixels += 1;
    }
    let share = 1.0 / values.max(1) as f64;
    let shared = |(block, noise): (u32, BlockNoise)| {
        let mut divided = BlockNoise::default();
        divided.add_scaled(share, &noise);
        (block, divided)
    };
    let blocks = by_block.into_iter().map(shared).collect();
    Ok((pixels > 0).then_some(NoiseFreeMse { mse: sum * share, pixels, blocks, common: 0.0 }))
}

/// Checks all sizes first, then the values inside the mask.
fn check<P: Pixel>(
    prediction: &NoisyRender<P>,
    reference: Halves<P>,
    mask: &Mask,
    blocks: &Picture<u32>,
) -> Result<(), MetricError> {
    let NoisyRender { a, b, shared } = prediction;
    let size = size_of(&a.estimate);
    let mut pictures = vec![
        ("prediction's first half", &a.estimate),
        ("noise of the prediction's first half", &a.noise),
        ("prediction's second half", &b.estimate),
        ("noise of the prediction's second half", &b.noise),
        ("reference's first half", reference.a),
        ("reference's second half", reference.b),
    ];
    pictures.extend(shared.as_ref().map(|shared| ("shared noise of the prediction", shared)));
    for (what, picture) in &pictures[1..] {
        check_size(size, what, size_of(picture))?;
    }
    check_size(size, "mask", size_of(mask))?;
    check_size(size, "picture of blocks", size_of(blocks))?;
    pictures.into_iter().try_for_each(|(what, picture)| check_finite(what, picture, Some(mask)))
}

impl NoiseFreeMse {
    /// The variances of `mse`.
    pub fn variances(&self) -> Variances {
        Variances::of(self.blocks.iter().map(|(_, noise)| noise), self.common)
    }

    /// The standard deviation of `mse`.
    pub fn standard_error(&self) -> f64 {
        self.variances().total().sqrt()
    }

    /// The MSE that its PSNR is of: `mse`, or 1.645 standard errors where that is more.
    pub fn bounded(&self) -> f64 {
        self.mse.max(ONE_SIDED_95 * self.standard_error())
    }

    /// The PSNR of [`Self::bounded`]: it never rises with `mse`, nor jumps. Fails if `mse` or the noise is not finite.
    pub fn psnr(&self) -> Result<NoiseFreePsnr, MetricError> {
        let bounded = self.bounded();
        if !(self.mse.is_finite() && bounded.is_finite()) {
            return Err(MetricError::InvalidMse { mse: self.mse });
        }
        let Psnr { db, exact } = Psnr::from_mse(bounded.max(0.0))?;
        Ok(NoiseFreePsnr { db, exact, lower_bound: self.mse < bounded })
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
    /// The MSE was under 1.645 standard errors and so may be 0. `db` is then the PSNR of 1.645 standard errors, and the true
    /// PSNR is probably higher.
    pub lower_bound: bool,
}

/// The standard error of a mean of PSNRs, decibels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoisePsnr {
    /// From all noise.
    pub total: f64,
    /// From the predictions' paths.
    pub paths: f64,
    /// The part of it that comes from products of both halves' noise ([`Variances::products`]).
    pub products: f64,
    /// From the noise that the quarters of a half share.
    pub shared: f64,
    /// From the references' noise.
    pub reference: f64,
    /// From the errors that all pixels have in common.
    pub common: f64,
}

/// The standard error of the mean PSNR of several views, decibels.
///
/// To first order, dPSNR = -10 / ln 10 * dMSE / MSE, with 1.645 standard errors in place of an MSE that is less. A block's
/// effects on all views are summed before they are squared, so that correlation between views counts. `None` without
/// views, or where an MSE is at most 0 without noise.
pub fn psnr_mean_error(views: &[&NoiseFreeMse]) -> Option<NoisePsnr> {
    if views.is_empty() || !views.iter().all(|view| view.bounded() > 0.0) {
        return None;
    }
    let (mut by_block, mut common): (BTreeMap<u32, BlockNoise>, f64) = Default::default();
    for view in views {
        let slope = -10.0 / LN_10 / view.bounded() / views.len() as f64;
        common += slope * view.common;
        for (block, noise) in &view.blocks {
            by_block.entry(*block).or_default().add_scaled(slope, noise);
        }
    }
    let variances = Variances::of(by_block.values(), common);
    Some(NoisePsnr {
        total: variances.total().sqrt(),
        paths: variances.paths.sqrt(),
        products: variances.products.sqrt(),
        shared: variances.shared.sqrt(),
        reference: variances.reference.sqrt(),
        common: variances.common.sqrt(),
    })
}

#[cfg(test)]
mod tests;
