//! Step 5: detail of the truth that the model lacks.

use super::model::Model;
use super::patch::Patch;

/// Standard deviations of the Gaussians, in pixels.
pub(super) const SIGMAS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// Adds b · (t - G t) to the model, with the b and the Gaussian G that bring it nearest to the truth t. Returns the
/// standard deviation of G, or none if no b above 0 brings the model nearer. G averages over the instance's pixels
/// alone.
pub(super) fn take(patches: &[Patch], model: &mut Model) -> Option<f64> {
    let mut best: Option<(f64, f64, f64, Model)> = None;
    for sigma in SIGMAS {
        let detail: Model = patches.iter().map(|patch| detail(patch, sigma)).collect();
        let (mut product, mut square) = (0.0, 0.0);
        for ((patch, model), detail) in patches.iter().zip(&*model).zip(&detail) {
            for ((truth, value), detail) in patch.truth.iter().zip(model).zip(detail) {
                for c in 0..3 {
                    product += (truth[c] - value[c]) * detail[c];
                    square += detail[c] * detail[c];
                }
            }
        }
        let gain = if product > 0.0 { product * product / square } else { 0.0 };
        if gain > best.as_ref().map_or(0.0, |(gain, ..)| *gain) {
            best = Some((gain, sigma, product / square, detail));
        }
    }
    let (_, sigma, amount, detail) = best?;
    for (value, detail) in model.iter_mut().flatten().zip(detail.iter().flatten()) {
        *value = std::array::from_fn(|c| value[c] + amount * detail[c]);
    }
    Some(sigma)
}

/// The truth minus the blurred truth.
pub(super) fn detail(patch: &Patch, sigma: f64) -> Vec<[f64; 3]> {
    let smooth = blurred(patch, sigma);
    patch.truth.iter().zip(smooth).map(|(t, s)| std::array::from_fn(|c| t[c] - s[c])).collect()
}

/// The truth blurred by a Gaussian over the instance's pixels alone, cut off at three standard deviations.
pub(super) fn blurred(patch: &Patch, sigma: f64) -> Vec<[f64; 3]> {
    let radius = (3.0 * sigma) as isize;
    let weights: Vec<f64> =
        (-radius..=radius).map(|d| libm::exp(-0.5 * (d as f64 / sigma) * (d as f64 / sigma))).collect();
    let [width, height] = patch.size;
    // Red, green and blue by weight, and the weight; nothing outside the instance.
    let mut values = vec![[0.0; 4]; width * height];
    for (pixel, [r, g, b]) in patch.truth.iter().enumerate() {
        let [x, y] = patch.in_box(pixel);
        values[y as usize * width + x as usize] = [*r, *g, *b, 1.0];
    }
    for (step, length) in [(1, width), (width, height)] {
        values = along(&values, step, length, &weights);
    }
    let value = |pixel: usize| {
        let [x, y] = patch.in_box(pixel);
        let [r, g, b, weight] = values[y as usize * width + x as usize];
        [r, g, b].map(|v| v / weight)
    };
    (0..patch.places.len()).map(value).collect()
}

/// Weighted sums along one axis, whose neighbours are `step` apart and which is `length` long.
fn along(values: &[[f64; 4]], step: usize, length: usize, weights: &[f64]) -> Vec<[f64; 4]> {
    let radius = weights.len() / 2;
    let sum = |at: usize| {
        let place = at / step % length;
        let mut sum = [0.0; 4];
        for other in place.saturating_sub(radius)..=(place + radius).min(length - 1) {
            let weight = weights[other + radius - place];
            let value = values[at - place * step + other * step];
            (0..4).for_each(|c| sum[c] += weight * value[c]);
        }
        sum
    };
    (0..values.len()).map(sum).collect()
}
