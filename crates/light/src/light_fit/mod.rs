//! The radiances under which a scene looks most like its photo.
//!
//! In: a light basis of the input view, or two independent ones (`two_streams`), and the photo. Out: one weight for each
//! light group and channel, and a proof that no others are better ([`RidgeFit`]). The weights are the non-negative ones with
//! the least sum of absolute differences between photo and weighted basis, plus a ridge towards a start: one weight for all
//! lights of a channel, with which the means of photo and basis agree. Where the photo is clipped, more light costs nothing.
//! Photo and basis are first averaged over squares of [`FitRules::pool`] pixels, because L1 on noisy pixels is biased
//! towards the median of the noise.

mod ridge_fit;
mod rows;
mod target;
mod two_streams;

use mateval_image::{LinearRgb, Picture};
use mateval_tracer::LightBasis;

use crate::error::LightError;
use crate::rules::FitRules;
pub use ridge_fit::{MOST_STEPS, RidgeFit, RidgeProblem, STEP_SHARE, TOLERANCE, ZERO_BELOW};
use rows::Rows;
pub use rows::pooled;
pub use target::FitTarget;
pub use two_streams::{TwoStreamFit, fit_two_streams};

/// Weights for a light basis.
#[derive(Clone, Debug, PartialEq)]
pub struct LightFit {
    /// Red, green and blue of each light group, not negative; they multiply the scene's own radiances.
    pub weights: Vec<[f64; 3]>,
    /// The weight of all lights that the ridge pulls towards, for each channel.
    pub start: [f64; 3],
    /// The solution of the fit for red, green and blue, as multiples of the start, each with its proof.
    pub channels: [RidgeFit; 3],
    /// The number of squares that the picture is divided into.
    pub squares: usize,
    /// The largest [`RidgeFit::relative_gap`] of the channels.
    pub relative_gap: f64,
}

/// Fits the basis to the photo.
///
/// Fails if sizes differ, if ridge or exposure are not above 0, if no weights are found, or if a picture holds values that
/// light cannot have: values that are not finite. The basis may be negative where noise was taken off it.
pub fn fit_lights(rules: &FitRules, basis: &LightBasis, target: &FitTarget<'_>) -> Result<LightFit, LightError> {
    check(rules, basis, target)?;
    let lights = basis.pictures().len();
    let squares = [target.photo.width(), target.photo.height()].map(|side| side.div_ceil(rules.pool.max(1) as usize));
    let fits = [0, 1, 2].map(|channel| ChannelFit::new(rules, basis, target, channel));
    let numbers = fits.iter().flat_map(|fit| fit.solution.multiples.iter().chain([&fit.gap, &fit.start]));
    if !numbers.into_iter().all(|v| v.is_finite()) {
        return Err(LightError::NoSolution { lights, squares: squares[0] * squares[1] });
    }
    let weight = |light: usize| [0, 1, 2].map(|channel| fits[channel].solution.multiples[light] * fits[channel].start);
    Ok(LightFit {
        weights: (0..lights).map(weight).collect(),
        start: [0, 1, 2].map(|channel| fits[channel].start),
        squares: squares[0] * squares[1],
        relative_gap: fits.iter().map(|fit| fit.gap).fold(0.0, f64::max),
        channels: fits.map(|fit| fit.solution),
    })
}

/// The fit of one channel.
struct ChannelFit {
    start: f64,
    solution: RidgeFit,
    gap: f64,
}

impl ChannelFit {
    fn new(rules: &FitRules, basis: &LightBasis, target: &FitTarget<'_>, channel: usize) -> Self {
        let rows = Rows::new(rules, target, channel);
        let photo = rows.of_photo();
        let mut columns: Vec<Vec<f64>> = basis.pictures().iter().map(|picture| rows.of(picture)).collect();
        // The start: one weight for all lights with which the means agree; 0 where nothing is lit.
        let light: f64 = columns.iter().flatten().sum();
        let start = if light > 0.0 { photo.iter().sum::<f64>().max(0.0) / light } else { 0.0 };
        columns.iter_mut().flatten().for_each(|value| *value *= start);
        // All lights at twice their start would make the ridge this share of the photo.
        let size: f64 = photo.iter().map(|v| v.abs()).sum();
        let ridge = rules.ridge * size / columns.len().max(1) as f64;
        let problem = RidgeProblem { ridge, target: photo, at_least: rows.at_least(), columns };
        let solution = problem.fit();
        Self { start, gap: solution.relative_gap(&problem.target), solution }
    }
}

fn check(rules: &FitRules, basis: &LightBasis, target: &FitTarget<'_>) -> Result<(), LightError> {
    let &FitTarget { photo: target, mask, exposure } = target;
    for (what, value) in [("ridge", rules.ridge), ("exposure", exposure)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(LightError::NotPositive { what, value });
        }
    }
    let photo = [target.width(), target.height()];
    if let Some(mask) = mask.filter(|mask| !mask.same_size(target)) {
        return Err(LightError::MaskSize { mask: [mask.width(), mask.height()], photo });
    }
    if let Some((at, value)) = first_pixel(target, |v| !v.is_finite()) {
        return Err(LightError::PhotoNotFinite { at, value });
    }
    for (group, picture) in basis.pictures().iter().enumerate() {
        if !picture.same_size(target) {
            return Err(LightError::BasisSize { basis: [picture.width(), picture.height()], photo });
        }
        if let Some((at, value)) = first_pixel(picture, |v| !v.is_finite()) {
            return Err(LightError::BasisPicture { group, at, value });
        }
    }
    Ok(())
}

/// Position and value of the first pixel with a channel that is `wrong`.
fn first_pixel(picture: &Picture<LinearRgb>, wrong: impl Fn(f32) -> bool) -> Option<([usize; 2], [f32; 3])> {
    let at = picture.pixels().iter().position(|pixel| pixel.0.iter().any(|v| wrong(*v)))?;
    Some(([at % picture.width(), at / picture.width()], picture.pixels()[at].0))
}

#[cfg(test)]
mod tests;
