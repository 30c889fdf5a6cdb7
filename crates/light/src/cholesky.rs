//! Positive definite systems of equations, by Cholesky's factors.
//!
//! Only +, -, *, / and square roots of f64 in a fixed order: the same bytes on every machine.

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums, so that four products can be under way at a time; in a fixed order.
    let (fours_a, fours_b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = fours_a.remainder().iter().zip(fours_b.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 4];
    for (a, b) in fours_a.zip(fours_b) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// The lower triangular L with L L^T = `matrix`; none if the matrix is not positive definite. Only its lower triangle
/// is read.
pub(crate) fn cholesky(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    for i in 0..matrix.len() {
        let (done, rest) = matrix.split_at_mut(i);
        let row = &mut rest[0];
        for (j, other) in done.iter().enumerate() {
            row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
        }
        let square = row[i] - dot(&row[..i], &row[..i]);
        if square.is_nan() || square <= 0.0 {
            return None;
        }
        row[i] = square.sqrt();
    }
    Some(matrix)
}

/// x of L L^T x = `right`.
pub(crate) fn back_substitute(factor: &[Vec<f64>], mut right: Vec<f64>) -> Vec<f64> {
    for (i, row) in factor.iter().enumerate() {
        right[i] = (right[i] - dot(&row[..i], &right[..i])) / row[i];
    }
    for i in (0..right.len()).rev() {
        right[i] /= factor[i][i];
        let value = right[i];
        factor[i][..i].iter().zip(&mut right).for_each(|(l, x)| *x -= l * value);
    }
    right
}
