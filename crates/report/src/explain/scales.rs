//! Steps 1 and 2: scales of a whole instance and of its channels.

use super::model::Model;
use super::patch::Patch;

/// Sums over all pixels, by channel: of truth times model, and of the model's squares.
fn sums(patches: &[Patch], model: &Model) -> ([f64; 3], [f64; 3]) {
    let (mut products, mut squares) = ([0.0; 3], [0.0; 3]);
    for (truth, model) in patches.iter().zip(model).flat_map(|(patch, model)| patch.truth.iter().zip(model)) {
        for c in 0..3 {
            products[c] += truth[c] * model[c];
            squares[c] += model[c] * model[c];
        }
    }
    (products, squares)
}

/// The scale with the least squared error; 1 if the model is black.
pub(super) fn best_scale(product: f64, square: f64) -> f64 {
    if square == 0.0 { 1.0 } else { product / square }
}

/// Multiplies the model by the one scale that brings it nearest to the truth. Returns the scale.
pub(super) fn take_scale(patches: &[Patch], model: &mut Model) -> f64 {
    let (products, squares) = sums(patches, model);
    let scale = best_scale(products.iter().sum(), squares.iter().sum());
    multiply(model, [scale; 3]);
    scale
}

/// Multiplies the model's channels by the scales that bring them nearest to the truth. Returns the scales.
pub(super) fn take_channel_scales(patches: &[Patch], model: &mut Model) -> [f64; 3] {
    let (products, squares) = sums(patches, model);
    let scales = std::array::from_fn(|c| best_scale(products[c], squares[c]));
    multiply(model, scales);
    scales
}

fn multiply(model: &mut Model, scales: [f64; 3]) {
    for pixel in model.iter_mut().flatten() {
        *pixel = std::array::from_fn(|c| pixel[c] * scales[c]);
    }
}
