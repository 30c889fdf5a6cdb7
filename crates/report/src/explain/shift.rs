//! Step 4: a small shift of one view of an instance.

use super::model::patch_error;
use super::patch::{FEWEST_PIXELS, Patch};

/// The farthest shift along either axis, in pixels.
pub(super) const FARTHEST: isize = 4;

/// How far the model of one view was moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shift {
    /// Number of the view.
    pub(super) view: usize,
    /// To the right and down.
    pub(super) pixels: [i32; 2],
}

/// A model's pixels times their factors.
pub(super) fn shaded(model: &[[f64; 3]], factors: &[f64]) -> Vec<[f64; 3]> {
    model.iter().zip(factors).map(|(value, factor)| value.map(|v| v * factor)).collect()
}

/// Moves the model by the whole pixels that bring it, times the factors, nearest to the truth, and multiplies it by the
/// factors. Returns none if the model is best unmoved. Factors do not move, and a pixel whose new value would come from
/// outside the instance keeps its own, so that a flat prediction cannot improve. Of equally good shifts, the first by
/// row, then by column, is taken.
pub(super) fn take(patch: &Patch, model: &mut [[f64; 3]], factors: &[f64]) -> Option<Shift> {
    let farthest = if model.len() < FEWEST_PIXELS { 0 } else { FARTHEST };
    let (mut least, mut best) = (patch_error(&patch.truth, &shaded(model, factors)), [0, 0]);
    for dy in -farthest..=farthest {
        for dx in -farthest..=farthest {
            let found = moved_error(patch, model, factors, [dx, dy], least);
            if found < least {
                (least, best) = (found, [dx, dy]);
            }
        }
    }
    let moved: Vec<[f64; 3]> = (0..model.len()).map(|pixel| moved(patch, model, factors, pixel, best)).collect();
    model.copy_from_slice(&moved);
    (best != [0, 0]).then(|| Shift { view: patch.view, pixels: best.map(|v| v as i32) })
}

fn moved(patch: &Patch, model: &[[f64; 3]], factors: &[f64], pixel: usize, [dx, dy]: [isize; 2]) -> [f64; 3] {
    let [x, y] = patch.in_box(pixel);
    model[patch.at(x - dx, y - dy).unwrap_or(pixel)].map(|v| v * factors[pixel])
}

/// The squared error after a shift, or any number of at least `enough` if the error is at least `enough`.
fn moved_error(patch: &Patch, model: &[[f64; 3]], factors: &[f64], shift: [isize; 2], enough: f64) -> f64 {
    let mut sum = 0.0;
    for (pixel, truth) in patch.truth.iter().enumerate() {
        let value = moved(patch, model, factors, pixel, shift);
        sum += (0..3).map(|c| (truth[c] - value[c]).powi(2)).sum::<f64>();
        if sum >= enough {
            break;
        }
    }
    sum
}
