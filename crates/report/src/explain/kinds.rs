//! An instance's squared error, taken apart by kind so that the parts add up.
//!
//! Let t be the truth's pixels of one instance in all views and channels, m0 = p the prediction's, in linear light. Each
//! step k changes the model m(k-1) to the m(k) that is nearest to t, in the sum of squares E(k) = |t - m(k)|², among those
//! that it may choose from:
//!
//! 1. scale: m1 = s m0, one s for all; s = <t, m0> / <m0, m0>.
//! 2. chroma: m2 = s_c m1, one s_c a channel, by the same formula.
//! 3. shading: m3 = m2 + m2 q_v(x, y), one quadratic polynomial a view, the same for all channels
//!    ([`super::smooth_field`]).
//! 4. misplacement: m4(x) = m2(x - d_v) (1 + q_v(x)), one whole-pixel shift a view; the polynomial stays
//!    ([`super::shift`]).
//! 5. detail: m5 = m4 + b (t - G t), one b >= 0, G the one of some Gaussians that does best ([`super::lost_detail`]).
//!
//! Steps 1, 2 and 3 are orthogonal projections of what is left, t - m(k-1), on the space that the step spans, step 5 is one
//! on a half line, and step 4 picks the best of a list that holds no change. So no step makes E larger, its kind's part is
//! E(k-1) - E(k) >= 0, the rest is E(5), and they add up to E(0).
//!
//! **Order matters.** An error that two steps could take away counts for the first. Scale and chroma take a little of
//! every error, as the best fit to what does not match is dimmer. A quadratic also follows what is smooth in the truth and
//! lacking in the prediction, which has nothing to do with light: of a flat prediction 'shading' is the truth's own slope.
//! Detail comes behind misplacement, as what is at the wrong place lacks where it should be. Detail of the prediction that
//! the truth does not have is rest. Views and instances of few pixels let steps 3 and 4 fit what is chance.

use super::file::KindShares;
use super::model::{Model, error};
use super::patch::Patch;
use super::{lost_detail, scales, shift, smooth_field};

/// What was found of one instance, or of several.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Explained {
    pub(super) pixels: usize,
    /// Sum over pixels and channels.
    pub(super) squared_error: f64,
    /// What is left after each step.
    left: [f64; 5],
    pub(super) scale: f64,
    pub(super) channel_scales: [f64; 3],
    /// Only those that are none.
    pub(super) shifts: Vec<shift::Shift>,
    pub(super) blur_sigma_pixels: Option<f64>,
}

/// Takes one instance's patches apart.
pub(super) fn explained(patches: &[Patch]) -> Explained {
    let mut model: Model = patches.iter().map(|patch| patch.predicted.clone()).collect();
    let squared_error = error(patches, &model);
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
    let left = [after_scale, after_chroma, after_shading, after_shift, error(patches, &model)];
    let pixels = patches.iter().map(|patch| patch.places.len()).sum();
    Explained { pixels, squared_error, left, scale, channel_scales, shifts, blur_sigma_pixels }
}

impl Explained {
    /// All of them as one; scales, shifts and blur are an instance's alone.
    pub(super) fn sum<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        let none = Self {
            pixels: 0,
            squared_error: 0.0,
            left: [0.0; 5],
            scale: 1.0,
            channel_scales: [1.0; 3],
            shifts: Vec::new(),
            blur_sigma_pixels: None,
        };
        all.fold(none, |sum, one| Self {
            pixels: sum.pixels + one.pixels,
            squared_error: sum.squared_error + one.squared_error,
            left: std::array::from_fn(|step| sum.left[step] + one.left[step]),
            ..sum
        })
    }

    /// Mean over pixels and channels; 0 where there are none.
    pub(super) fn mse(&self) -> f64 {
        if self.pixels == 0 { 0.0 } else { self.squared_error / (3 * self.pixels) as f64 }
    }

    /// The shares; none where there is no error.
    pub(super) fn kinds(&self) -> Option<KindShares> {
        let [scale, chroma, shading, shift, detail] = self.left;
        let share = |before: f64, after: f64| (before - after) / self.squared_error;
        (self.squared_error > 0.0).then(|| KindShares {
            scale: share(self.squared_error, scale),
            chroma: share(scale, chroma),
            shading: share(chroma, shading),
            misplacement: share(shading, shift),
            detail: share(shift, detail),
            rest: share(detail, 0.0),
        })
    }
}
