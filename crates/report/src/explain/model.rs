//! The model of one instance's pixels that the steps bring nearer to the truth, and its squared error.

use super::patch::Patch;

/// Linear RGB of every pixel, patch by patch, in the order of the patch's places.
pub(super) type Model = Vec<Vec<[f64; 3]>>;

/// The squared error of all patches, summed over pixels and channels.
pub(super) fn error(patches: &[Patch], model: &Model) -> f64 {
    patches.iter().zip(model).map(|(patch, model)| patch_error(&patch.truth, model)).sum()
}

/// The squared error of one patch, summed over pixels and channels.
pub(super) fn patch_error(truth: &[[f64; 3]], model: &[[f64; 3]]) -> f64 {
    truth.iter().zip(model).map(|(t, m)| (0..3).map(|c| (t[c] - m[c]).powi(2)).sum::<f64>()).sum()
}
