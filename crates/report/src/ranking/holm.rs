//! Holm's correction of p-values for many comparisons at once.

/// Chances that are less are differences.
pub(super) const LEVEL: f64 = 0.05;

/// Chances corrected for so many tests (Holm 1979): under [`LEVEL`] where Holm's steps refuse.
pub(super) fn corrected(chances: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..chances.len()).collect();
    order.sort_by(|&a, &b| chances[a].total_cmp(&chances[b]));
    let mut corrected = vec![0.0; chances.len()];
    let mut largest: f64 = 0.0;
    for (done, at) in order.into_iter().enumerate() {
        largest = largest.max(chances[at] * (chances.len() - done) as f64);
        corrected[at] = largest.min(1.0);
    }
    corrected
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As R's `p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm")` gives them.
    #[test]
    fn holm_as_r_does() {
        let corrected = corrected(&[0.01, 0.04, 0.03, 0.005]);
        for (found, expected) in corrected.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - expected).abs() < 1e-15, "{corrected:?}");
        }
    }
}
