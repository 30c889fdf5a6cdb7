//! A noisy prediction of light as SSIM, LPIPS and people see it: with little noise, and without blurring its textures.
//!
//! Most of a predicted picture is known without noise of its own: it is close to the truth's picture T, from which noise was
//! taken, times the ratio r of the predicted base colour to the true one (at most
//! [`MOST_RATIO`]). What remains, P - r T, is light that the
//! prediction's own colours bounce, and reflections. It alone is filtered ([`mateval_tracer::noise_filter`]): what is shown
//! converges to the prediction as samples grow.

use mateval_image::{LinearRgb, Picture};
use mateval_tracer::noise_filter::{Surfaces, filtered_mean};

/// The largest ratio by which the truth's picture is multiplied: what it holds of noise and of a denoiser's traces must not
/// become visible.
pub const MOST_RATIO: f32 = 2.0;

/// What is known about a view without noise.
#[derive(Clone, Copy)]
pub struct ViewGuide<'a> {
    /// The truth's picture (`rgb.exr`, or its like of a lighting), exposed.
    pub truth: &'a Picture<LinearRgb>,
    /// The predicted base colour over the true one.
    pub ratio: &'a Picture<LinearRgb>,
    /// The predicted base colour, and what the view shows.
    pub surfaces: Surfaces<'a>,
}

/// The mean of two independent halves, exposed, with the noise of its remainder filtered. Pixels that do not count are
/// those of the mean.
pub fn shown_render(halves: [&Picture<LinearRgb>; 2], guide: &ViewGuide<'_>) -> Picture<LinearRgb> {
    let ViewGuide { truth, ratio, surfaces } = guide;
    let combined = |picture: &Picture<LinearRgb>, sign: f32| {
        Picture::from_fn(picture.width(), picture.height(), |x, y| {
            let (value, truth, ratio) = (picture.get(x, y).0, truth.get(x, y).0, ratio.get(x, y).0);
            LinearRgb([0, 1, 2].map(|c| value[c] + sign * truth[c] * ratio[c].min(MOST_RATIO)))
        })
    };
    let [a, b] = halves.map(|half| combined(half, -1.0));
    combined(&filtered_mean([&a, &b], surfaces), 1.0)
}
