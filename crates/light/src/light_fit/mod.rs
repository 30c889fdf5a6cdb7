//! The radiances under which a scene looks most like its photo.
//!
//! In: a light basis of the input view and the photo. Out: one weight for each light group and channel, the non-negative
//! ones with the least sum of absolute differences, and a proof that they are ([`NonnegativeL1`]). Both are first averaged
//! over squares of [`FitRules::pool`] pixels, because L1 on noisy pixels is biased towards the median of the noise.

mod nonnegative_l1;

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_tracer::LightBasis;

use crate::error::LightError;
use crate::rules::FitRules;
pub use nonnegative_l1::{MOST_STEPS, NonnegativeL1, SHORTNESS, STEP_SHARE, TOLERANCE, ZERO_BELOW, solve};

/// Weights for a light basis.
#[derive(Clone, Debug, PartialEq)]
pub struct LightFit {
    /// Red, green and blue of each light group, not negative; they multiply the scene's own radiances.
    pub weights: Vec<[f64; 3]>,
    /// The solution of the fit for red, green and blue, each with the proof that no other weights fit better.
    pub channels: [NonnegativeL1; 3],
    /// The largest [`NonnegativeL1::relative_gap`] of the channels.
    pub relative_gap: f64,
}

/// Fits the basis to `target`, by the pixels in `mask` if there is one.
///
/// Fails if sizes differ, if no weights are found, or if a picture holds values that light cannot have: values that are not
/// finite, or negative ones in the basis.
pub fn fit_lights(
    rules: &FitRules,
    basis: &LightBasis,
    target: &Picture<LinearRgb>,
    mask: Option<&Mask>,
) -> Result<LightFit, LightError> {
    check(basis, target, mask)?;
    let target = pooled(rules, target, mask);
    let columns: Vec<[Vec<f64>; 3]> = basis.pictures().iter().map(|picture| pooled(rules, picture, mask)).collect();
    let channels = [0, 1, 2].map(|channel| {
        let columns: Vec<Vec<f64>> = columns.iter().map(|column| column[channel].clone()).collect();
        solve(&columns, &target[channel])
    });
    let gaps = [0, 1, 2].map(|channel| channels[channel].relative_gap(&target[channel]));
    let numbers = channels.iter().flat_map(|fit| &fit.weights).chain(&gaps);
    if !numbers.into_iter().all(|v| v.is_finite()) {
        return Err(LightError::NoSolution { lights: columns.len(), squares: target[0].len() });
    }
    let relative_gap = gaps.into_iter().fold(0.0, f64::max);
    let weights = (0..columns.len()).map(|group| [0, 1, 2].map(|channel| channels[channel].weights[group]));
    Ok(LightFit { weights: weights.collect(), channels, relative_gap })
}

/// Averages over squares of [`FitRules::pool`] pixels, by channel. Pixels outside the mask or the picture count as black,
/// so that every pixel has the same weight.
pub fn pooled(rules: &FitRules, picture: &Picture<LinearRgb>, mask: Option<&Mask>) -> [Vec<f64>; 3] {
    let pool = rules.pool.max(1) as usize;
    let (columns, rows) = (picture.width().div_ceil(pool), picture.height().div_ceil(pool));
    let mut sums = [0, 1, 2].map(|_| vec![0.0; columns * rows]);
    for y in 0..picture.height() {
        for x in 0..picture.width() {
            if mask.is_none_or(|mask| mask.get(x, y)) {
                let square = y / pool * columns + x / pool;
                for (sums, value) in sums.iter_mut().zip(picture.get(x, y).0) {
                    sums[square] += f64::from(value) / (pool * pool) as f64;
                }
            }
        }
    }
    sums
}

fn check(basis: &LightBasis, target: &Picture<LinearRgb>, mask: Option<&Mask>) -> Result<(), LightError> {
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
        if let Some((at, value)) = first_pixel(picture, |v| !v.is_finite() || v < 0.0) {
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
mod tests {
    use super::*;

    /// Three lights on 30 x 20 pixels: from the left, from the top, from everywhere.
    fn basis() -> LightBasis {
        let picture = |light: fn(f32, f32) -> f32| {
            Picture::from_fn(30, 20, |x, y| {
                let value = light(x as f32 / 30.0, y as f32 / 20.0);
                LinearRgb([value, 0.5 * value, 0.25 * value * value])
            })
        };
        let pictures = vec![picture(|x, _| (1.0 - x) * (1.0 - x)), picture(|_, y| 1.0 - y), picture(|_, _| 0.5)];
        LightBasis::new(30, 20, pictures).unwrap()
    }

    fn rules() -> FitRules {
        FitRules::default()
    }

    const WEIGHTS: [[f64; 3]; 3] = [[0.5, 2.0, 0.0], [1.0, 0.0, 3.0], [0.0, 0.25, 1.0]];

    fn error(fit: &LightFit) -> f64 {
        let pairs = fit.weights.iter().flatten().zip(WEIGHTS.iter().flatten());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn weights_of_each_channel_are_found() {
        let fit = fit_lights(&rules(), &basis(), &basis().weighted(&WEIGHTS).unwrap(), None).unwrap();
        assert!(error(&fit) < 1e-5, "{:?}", fit.weights);
        assert!(fit.relative_gap < 1e-6, "{}", fit.relative_gap);
    }

    /// A window that no light of the basis explains does not count when it is masked out, and does when it fills half.
    #[test]
    fn pixels_outside_the_mask_do_not_count() {
        let mut target = basis().weighted(&WEIGHTS).unwrap();
        let mask = Mask::from_fn(30, 20, |x, _| x < 13);
        for y in 0..20 {
            (13..30).for_each(|x| target.set(x, y, LinearRgb([9.0; 3])));
        }
        assert!(error(&fit_lights(&rules(), &basis(), &target, Some(&mask)).unwrap()) < 1e-5);
        assert!(error(&fit_lights(&rules(), &basis(), &target, None).unwrap()) > 0.1, "the twin passes");
    }

    #[test]
    fn squares_are_averaged_and_edges_count_by_area() {
        let picture = Picture::from_fn(12, 8, |x, y| LinearRgb([(x + y) as f32, 1.0, 0.0]));
        let [red, green, blue] = pooled(&rules(), &picture, None);
        assert_eq!((red[0], &green[..], &blue[..]), (7.0, &[1.0, 0.5][..], &[0.0, 0.0][..]));
    }

    #[test]
    fn what_cannot_be_fitted_is_refused() {
        let message = |basis: &LightBasis, target: &Picture<LinearRgb>, mask: Option<&Mask>| {
            fit_lights(&rules(), basis, target, mask).unwrap_err().to_string()
        };
        let target = basis().sum();
        let small = Picture::filled(4, 4, LinearRgb([1.0; 3]));
        assert!(message(&basis(), &small, None).contains("the basis has 30x20 pixels, the photo 4x4"));
        assert!(message(&basis(), &target, Some(&Mask::filled(4, 4, true))).contains("the mask"));
        let mut broken = target.clone();
        broken.set(3, 3, LinearRgb([f32::NAN; 3]));
        assert!(message(&basis(), &broken, None).contains("pixel (3, 3) of the photo is [NaN"));
        let mut negative = basis().pictures().to_vec();
        negative[1].set(0, 0, LinearRgb([-1e-9; 3]));
        let negative = LightBasis::new(30, 20, negative).unwrap();
        assert!(message(&negative, &target, None).contains("light group 1"));
    }

    /// Black photos and no lights at all are fitted, by nothing.
    #[test]
    fn nothing_is_fitted_by_nothing() {
        let black = fit_lights(&rules(), &basis(), &Picture::filled(30, 20, LinearRgb::default()), None).unwrap();
        assert_eq!((black.weights, black.relative_gap), (vec![[0.0; 3]; 3], 0.0));
        let none = LightBasis::new(30, 20, Vec::new()).unwrap();
        let fit = fit_lights(&rules(), &none, &basis().sum(), None).unwrap();
        assert!(fit.weights.is_empty() && fit.relative_gap == 0.0, "{fit:?}");
    }
}
