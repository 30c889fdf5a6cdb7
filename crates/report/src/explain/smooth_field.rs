//! Step 3: a smooth factor for one view of an instance.

use super::patch::{FEWEST_PIXELS, Patch};

/// 1, x, y and their products of second order.
const TERMS: usize = 6;
/// A term is left out if less than this share of its squares is independent of the terms before it, as in a patch of
/// one row.
const LEAST_NEW: f64 = 1e-9;

/// The factor 1 + q for each pixel, where q is the quadratic polynomial of its position that brings model · (1 + q)
/// nearest to the truth: the residual is projected on the products of the model and each term. All channels share the
/// polynomial.
pub(super) fn factors(patch: &Patch, model: &[[f64; 3]]) -> Vec<f64> {
    if model.len() < FEWEST_PIXELS {
        return vec![1.0; model.len()];
    }
    let (mut matrix, mut right) = ([[0.0; TERMS]; TERMS], [0.0; TERMS]);
    for (pixel, value) in model.iter().enumerate() {
        let terms = terms(patch, pixel);
        let square: f64 = value.iter().map(|v| v * v).sum();
        let product: f64 = (0..3).map(|c| (patch.truth[pixel][c] - value[c]) * value[c]).sum();
        for i in 0..TERMS {
            right[i] += product * terms[i];
            for j in 0..TERMS {
                matrix[i][j] += square * terms[i] * terms[j];
            }
        }
    }
    let weights = solution(matrix, right);
    let factor =
        |pixel| 1.0 + terms(patch, pixel).iter().zip(&weights).map(|(term, weight)| term * weight).sum::<f64>();
    (0..model.len()).map(factor).collect()
}

/// The terms of the polynomial at a pixel, whose position runs from -1 to 1 over the patch's box.
fn terms(patch: &Patch, pixel: usize) -> [f64; TERMS] {
    let place = patch.in_box(pixel);
    let [x, y] = [0, 1].map(|axis| match patch.size[axis] {
        1 => 0.0,
        size => 2.0 * place[axis] as f64 / (size - 1) as f64 - 1.0,
    });
    [1.0, x, y, x * x, x * y, y * y]
}

/// Solves the normal equations by Cholesky decomposition; a term that depends on those before it gets weight 0.
fn solution(matrix: [[f64; TERMS]; TERMS], right: [f64; TERMS]) -> [f64; TERMS] {
    let mut lower = [[0.0; TERMS]; TERMS];
    let mut forward = [0.0; TERMS];
    for i in 0..TERMS {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            lower[i][j] = match (i == j, lower[j][j]) {
                (true, _) => {
                    if rest > LEAST_NEW * matrix[i][i] {
                        rest.sqrt()
                    } else {
                        0.0
                    }
                }
                (false, 0.0) => 0.0,
                (false, pivot) => rest / pivot,
            };
        }
        let rest = right[i] - (0..i).map(|k| lower[i][k] * forward[k]).sum::<f64>();
        forward[i] = if lower[i][i] == 0.0 { 0.0 } else { rest / lower[i][i] };
    }
    let mut weights = [0.0; TERMS];
    for i in (0..TERMS).rev() {
        let rest = forward[i] - (i + 1..TERMS).map(|k| lower[k][i] * weights[k]).sum::<f64>();
        weights[i] = if lower[i][i] == 0.0 { 0.0 } else { rest / lower[i][i] };
    }
    weights
}
