//! Holm's correction of p-values for many comparisons at once.

/// Differences with a corrected p-value below this are significant.
pub(super) const LEVEL: f64 = 0.05;

/// p-values corrected for their number (Holm 1979): below [`LEVEL`] where Holm's procedure rejects equality.
pub(super) fn corrected(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut corrected = vec![0.0; p_values.len()];
    let mut largest: f64 = 0.0;
    for (done, at) in order.into_iter().enumerate() {
        largest = largest.max(p_values[at] * (p_values.len() - done) as f64);
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
