//! The distance between the features of two pictures.

use rayon::prelude::*;

use super::features::Features;
use super::net::Network;
use super::tensor::Tensor;

/// The sum over stages of the mean over the stage's pixels.
pub(crate) fn mean(network: &Network, prediction: &Features, reference: &Features) -> f64 {
    let means = maps(network, prediction, reference).map(|(_, map)| map.iter().sum::<f64>() / map.len() as f64);
    means.sum()
}

/// The sum over stages and pixels of the stages' maps, each enlarged to the picture's size.
pub(crate) fn enlarged_sum(network: &Network, prediction: &Features, reference: &Features) -> f64 {
    let sums = maps(network, prediction, reference).map(|(stage, map)| {
        // The enlarged map is not computed: its sum is a weighted sum of the stage's values.
        let columns = enlarged_counts(stage.width, prediction.width());
        let rows = enlarged_counts(stage.height, prediction.height());
        let row_sum = |row: &[f64]| row.iter().zip(&columns).map(|(value, count)| value * count).sum::<f64>();
        map.chunks(stage.width).zip(&rows).map(|(row, count)| row_sum(row) * count).sum::<f64>()
    });
    sums.sum()
}

/// For each stage, the reference's tensor and the distance at each of its pixels.
fn maps<'a>(
    network: &'a Network,
    prediction: &'a Features,
    reference: &'a Features,
) -> impl Iterator<Item = (&'a Tensor, Vec<f64>)> {
    let pairs = prediction.stages.iter().zip(&reference.stages);
    network.stages.iter().zip(pairs).map(|(stage, (p, r))| (r, map(&stage.linear, p, r)))
}

/// The weighted squared differences of each pixel, summed over its channels.
fn map(linear: &[f32], prediction: &Tensor, reference: &Tensor) -> Vec<f64> {
    let predicted = prediction.values.par_chunks(linear.len()).with_min_len(256);
    predicted.zip(reference.values.par_chunks(linear.len())).map(|(p, r)| pixel_distance(linear, p, r)).collect()
}

fn pixel_distance(linear: &[f32], p: &[f32], r: &[f32]) -> f64 {
    let terms = linear.iter().zip(p.iter().zip(r));
    terms.map(|(&weight, (&p, &r))| f64::from(weight) * (f64::from(p) - f64::from(r)).powi(2)).sum()
}

/// The weight of each of `from` samples in the sum over `to` samples interpolated linearly between them, with pixel
/// centres at one half and the ends continued (torch's `bilinear` with `align_corners=False`). The weights add to `to`.
fn enlarged_counts(from: usize, to: usize) -> Vec<f64> {
    let mut counts = vec![0.0; from];
    for target in 0..to {
        let position = ((target as f64 + 0.5) * from as f64 / to as f64 - 0.5).max(0.0);
        let left = (position as usize).min(from - 1);
        let share = if left + 1 < from { position - left as f64 } else { 0.0 };
        counts[left] += 1.0 - share;
        counts[(left + 1).min(from - 1)] += share;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed by hand: two samples enlarged to four lie at 0, 0.25, 0.75 and 1; three are unchanged.
    #[test]
    fn counts_by_hand() {
        assert_eq!(enlarged_counts(2, 4), [2.0, 2.0]);
        assert_eq!(enlarged_counts(3, 3), [1.0, 1.0, 1.0]);
        // Three to six: -0.25 (held at 0), 0.25, 0.75, 1.25, 1.75, 2.25 (held at 2).
        assert_eq!(enlarged_counts(3, 6), [2.0, 2.0, 2.0]);
        // Two to three: positions -1/6 (0), 1/2, 7/6 (1).
        assert_eq!(enlarged_counts(2, 3), [1.5, 1.5]);
        // Three to four: 0, 0.625, 1.375, 2.
        assert_eq!(enlarged_counts(3, 4), [1.375, 1.25, 1.375]);
    }

    #[test]
    fn every_target_counts_once() {
        for (from, to) in [(1, 1), (1, 7), (2, 31), (31, 512), (127, 512), (7, 31), (5, 3)] {
            assert!((enlarged_counts(from, to).iter().sum::<f64>() - to as f64).abs() < 1e-9);
        }
    }
}
