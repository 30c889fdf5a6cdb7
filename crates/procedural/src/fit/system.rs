//! Weighted sums of squares as linear systems, solved by Cholesky's factors.
//!
//! Only +, -, *, / and square roots in a fixed order: the same bytes on every machine.

/// The normal equations of a linear least squares problem.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    /// The lower triangle, row by row.
    rows: Vec<Vec<f64>>,
    right: Vec<f64>,
}

impl Normal {
    /// No equations yet.
    pub(super) fn new(unknowns: usize) -> Self {
        Self { rows: (1..=unknowns).map(|length| vec![0.0; length]).collect(), right: vec![0.0; unknowns] }
    }

    /// Adds the equation `row . x = value`. Zeros of the row cost nothing.
    pub(super) fn add(&mut self, row: &[f64], value: f64, weight: f64) {
        for (i, a) in row.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            let scaled = weight * a;
            self.rows[i].iter_mut().zip(row).for_each(|(sum, b)| *sum += scaled * b);
            self.right[i] += scaled * value;
        }
    }

    /// The least squares solution, after `ridge(unknown, diagonal)` is added to the diagonal; `None` where the system
    /// is singular.
    pub(super) fn solve(&self, ridge: impl Fn(usize, f64) -> f64) -> Option<Vec<f64>> {
        let mut factor = self.rows.clone();
        for i in 0..factor.len() {
            let (done, rest) = factor.split_at_mut(i);
            let row = &mut rest[0];
            row[i] += ridge(i, row[i]);
            for (j, other) in done.iter().enumerate() {
                row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
            }
            let square = row[i] - dot(&row[..i], &row[..i]);
            if square.is_nan() || square <= 0.0 {
                return None;
            }
            row[i] = square.sqrt();
        }
        Some(substituted(&factor, self.right.clone()))
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// x of L L^T x = `right`.
fn substituted(factor: &[Vec<f64>], mut right: Vec<f64>) -> Vec<f64> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_equations_are_solved_and_ridges_pull_to_zero() {
        let mut normal = Normal::new(2);
        for (x, weight) in [(0.0, 1.0), (1.0, 2.0), (3.0, 0.5)] {
            normal.add(&[1.0, x], 2.0 - 0.5 * x, weight);
        }
        let exact = normal.solve(|_, _| 0.0).unwrap();
        assert!((exact[0] - 2.0).abs() < 1e-12 && (exact[1] + 0.5).abs() < 1e-12, "{exact:?}");
        let pulled = normal.solve(|at, _| if at == 1 { 1e9 } else { 0.0 }).unwrap();
        assert!(pulled[1].abs() < 1e-6, "{pulled:?}");
        assert_eq!(Normal::new(2).solve(|_, _| 0.0), None);
    }
}
