//! An instance's squared error, taken apart by kind so that the parts add up.
//!
//! First, the error in pixels whose surface the photo does not show is set apart: nothing in the photo determines it.
//! Over the other pixels of one instance, in all views and channels, let t be the truth and m0 = p the prediction, both
//! linear. Step k replaces the model m(k-1) by that m(k) of its family of models which is nearest to t, in the sum of
//! squares E(k) = |t - m(k)|²:
//!
//! 1. scale: m1 = s m0, one s for all; s = <t, m0> / <m0, m0>.
//! 2. chroma: m2 = s_c m1, one s_c a channel, by the same formula.
//! 3. shading: m3 = m2 + m2 q_v(x, y), one quadratic polynomial a view, the same for all channels
//!    ([`super::smooth_field`]).
//! 4. misplacement: m4(x) = m2(x - d_v) (1 + q_v(x)), one whole-pixel shift a view; the polynomial stays
//!    ([`super::shift`]).
//! 5. detail: m5 = m4 + b (t - G t), one b >= 0, G the one of some Gaussians that does best ([`super::lost_detail`]).
//!
//! Steps 1, 2 and 3 are orthogonal projections of the residual t - m(k-1) on the space that the step spans, step 5 is
//! one on a half line, and step 4 picks the best of a list that includes no shift. No step therefore increases E: the
//! part of its kind is E(k-1) - E(k) >= 0 and the rest is E(5). Together with the unobserved part they add up to the
//! whole error.
//!
//! **Order matters.** An error that two steps could remove counts for the first of them. Scale and chroma remove a
//! little of every error, because the best fit to values that do not match is dimmer. A quadratic also follows smooth
//! changes of the truth that the prediction lacks, whether or not light causes them: for a flat prediction, 'shading'
//! is the slope of the truth itself. Detail comes after misplacement, because misplaced detail is missing where it
//! belongs. Detail of the prediction that the truth does not have is rest. In views and instances of few pixels, steps
//! 3 and 4 fit chance.

use super::file::KindShares;
use super::model::{Model, error};
use super::patch::Patch;
use super::{lost_detail, scales, shift, smooth_field};

/// The error of one instance, or of several, taken apart.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Explained {
    pub(super) pixels: usize,
    /// The number of those pixels whose surface the photo does not show.
    pub(super) unobserved_pixels: usize,
    /// Sum over pixels and channels.
    pub(super) squared_error: f64,
    /// The squared error in observed pixels: before the first step, and after each step.
    left: [f64; 6],
    pub(super) scale: f64,
    pub(super) channel_scales: [f64; 3],
    /// The shifts of step 4, for the views in which one lowers the error.
    pub(super) shifts: Vec<shift::Shift>,
    pub(super) blur_sigma_pixels: Option<f64>,
}

/// Takes the error of one instance apart, given its patches.
pub(super) fn explained(patches: &[Patch]) -> Explained {
    let whole: Model = patches.iter().map(|patch| patch.predicted.clone()).collect();
    let squared_error = error(patches, &whole);
    let pixels = patches.iter().map(|patch| patch.places.len()).sum();
    let unobserved_pixels = patches.iter().flat_map(|patch| &patch.observed).filter(|observed| !**observed).count();
    let patches = &patches.iter().filter_map(Patch::observed_part).collect::<Vec<_>>()[..];
    let mut model: Model = patches.iter().map(|patch| patch.predicted.clone()).collect();
    let observed = error(patches, &model);
    let scale = scales::take_scale(patches, &mut model);
    let after_scale = error(patches, &model);
    let channel_scales = scales::take_channel_scales(patches, &mut model);
    let after_chroma = error(patches, &model);
    let factors: Vec<Vec<f64>> =
        patches.iter().zip(&model).map(|(patch, model)| smooth_field::factors(patch, model)).collect();
    let unmoved: Model = model.iter().zip(&factors).map(|(model, factors)| shift::shaded(model, factors)).collect();
    let after_shading = error(patches, &unmoved);
    let views = patches.iter().zip(&mut model).zip(&factors);
    let shifts = views.filter_map(|((patch, model), factors)| shift::take(patch, model, factors)).collect();
    let after_shift = error(patches, &model);
    let blur_sigma_pixels = lost_detail::take(patches, &mut model);
    let left = [observed, after_scale, after_chroma, after_shading, after_shift, error(patches, &model)];
    Explained { pixels, unobserved_pixels, squared_error, left, scale, channel_scales, shifts, blur_sigma_pixels }
}

impl Explained {
    /// The sum over several instances, without scales, shifts and blur, which only single instances have.
    pub(super) fn sum<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        let none = Self {
            pixels: 0,
            unobserved_pixels: 0,
            squared_error: 0.0,
            left: [0.0; 6],
            scale: 1.0,
            channel_scales: [1.0; 3],
            shifts: Vec::new(),
            blur_sigma_pixels: None,
        };
        all.fold(none, |sum, one| Self {
            pixels: sum.pixels + one.pixels,
            unobserved_pixels: sum.unobserved_pixels + one.unobserved_pixels,
            squared_error: sum.squared_error + one.squared_error,
            left: std::array::from_fn(|step| sum.left[step] + one.left[step]),
            ..sum
        })
    }

    /// Mean squared error over pixels and channels; 0 if there are no pixels.
    pub(super) fn mse(&self) -> f64 {
        if self.pixels == 0 { 0.0 } else { self.squared_error / (3 * self.pixels) as f64 }
    }

    /// The shares of the kinds; none if there is no error.
    pub(super) fn kinds(&self) -> Option<KindShares> {
        let [observed, scale, chroma, shading, shift, detail] = self.left;
        let share = |before: f64, after: f64| (before - after) / self.squared_error;
        (self.squared_error > 0.0).then(|| KindShares {
            unobserved: share(self.squared_error, observed),
            scale: share(observed, scale),
            chroma: share(scale, chroma),
            shading: share(chroma, shading),
            misplacement: share(shading, shift),
            detail: share(shift, detail),
            rest: share(detail, 0.0),
        })
    }
}
