//! The distance between the features of two pictures.

use mateval_image::Mask;
use rayon::prelude::*;

use super::features::{self, Features, Responses};
use super::net::Network;
use super::reach::PixelSet;
use super::tensor::Tensor;
use crate::error::Size;

/// How much each pixel of a stage counts, row by row.
pub(crate) struct StageWeights {
    size: Size,
    weights: Vec<f64>,
}

/// The sum over stages of the mean over the stage's pixels.
pub(crate) fn mean(network: &Network, prediction: &Features, reference: &Features) -> f64 {
    let stages = network.stages.iter().zip(prediction.stages.iter().zip(&reference.stages));
    let means = stages.map(|(stage, (p, r))| {
        let distances = distances(&stage.linear, p, r, &(0..p.pixels()).collect::<Vec<_>>());
        distances.iter().sum::<f64>() / distances.len() as f64
    });
    means.sum()
}

/// The sum over stages and pixels of the distance of a picture, given as the network's input, from `reference`, times
/// the weights. Only responses in which the two may differ are computed.
pub(crate) fn weighted(network: &Network, input: &Tensor, reference: &Features, weights: &[StageWeights]) -> f64 {
    let needed: Vec<PixelSet> = weights.iter().map(StageWeights::counted).collect();
    let changed = features::compute_changed(network, input, reference, &needed);
    let stages = network.stages.iter().zip(changed).zip(reference.stages.iter().zip(weights));
    let sums = stages.map(|((stage, (prediction, computed)), (reference, StageWeights { weights, .. }))| {
        let counted: Vec<usize> = computed.into_iter().filter(|&pixel| weights[pixel] > 0.0).collect();
        let distances = distances(&stage.linear, &prediction, reference, &counted);
        counted.iter().zip(distances).map(|(&pixel, distance)| weights[pixel] * distance).sum::<f64>()
    });
    sums.sum()
}

impl StageWeights {
    /// For [`mean`]: every pixel of a stage counts alike, and all of them together 1.
    pub(crate) fn of_mean(network: &Network, picture: Size) -> Vec<Self> {
        let even = |size: Size| Self { size, weights: vec![1.0 / (size.0 * size.1) as f64; size.0 * size.1] };
        features::stage_sizes(network, picture).into_iter().map(even).collect()
    }

    /// For the mean over the mask of the stages' maps, each enlarged bilinearly to the picture's size. The enlarged maps
    /// are not computed: their sum is a weighted sum of the stage's values.
    pub(crate) fn inside(network: &Network, mask: &Mask) -> Vec<Self> {
        let picture = (mask.width(), mask.height());
        features::stage_sizes(network, picture).into_iter().map(|size| Self::enlarged(size, mask)).collect()
    }

    fn enlarged(size: Size, mask: &Mask) -> Self {
        let columns = enlarged_places(size.0, mask.width());
        let rows = enlarged_places(size.1, mask.height());
        let mut weights = vec![0.0; size.0 * size.1];
        let mut pixels = 0_usize;
        for (row, place) in mask.pixels().chunks(mask.width()).zip(&rows) {
            let mut sums = vec![0.0; size.0];
            for Place { left, right, share } in columns.iter().zip(row).filter(|(_, counts)| **counts).map(|(at, _)| at)
            {
                sums[*left] += 1.0 - share;
                sums[*right] += share;
                pixels += 1;
            }
            for (x, sum) in sums.into_iter().enumerate() {
                weights[place.left * size.0 + x] += (1.0 - place.share) * sum;
                weights[place.right * size.0 + x] += place.share * sum;
            }
        }
        weights.iter_mut().for_each(|weight| *weight /= pixels.max(1) as f64);
        Self { size, weights }
    }

    /// The pixels that count.
    fn counted(&self) -> PixelSet {
        let holds = self.weights.iter().map(|&weight| weight > 0.0).collect();
        PixelSet { width: self.size.0, height: self.size.1, holds }
    }
}

/// For each of these pixels, the weighted squared differences of its normalised channels, summed.
fn distances(linear: &[f32], prediction: &Responses, reference: &Responses, pixels: &[usize]) -> Vec<f64> {
    let distance = |&pixel: &usize| -> f64 {
        let pairs = prediction.normalized(pixel).zip(reference.normalized(pixel));
        linear
            .iter()
            .zip(pairs)
            .map(|(&weight, (p, r))| f64::from(weight) * (f64::from(p) - f64::from(r)).powi(2))
            .sum()
    };
    pixels.par_iter().with_min_len(64).map(distance).collect()
}

/// The two samples that a sample of an enlarged row is interpolated between.
struct Place {
    left: usize,
    right: usize,
    /// The weight of the right one.
    share: f64,
}

/// The places of `to` samples interpolated linearly between `from`, with pixel centres at one half and the ends continued
/// (torch's `bilinear` with `align_corners=False`).
fn enlarged_places(from: usize, to: usize) -> Vec<Place> {
    let place = |target: usize| {
        let position = ((target as f64 + 0.5) * from as f64 / to as f64 - 0.5).max(0.0);
        let left = (position as usize).min(from - 1);
        let share = if left + 1 < from { position - left as f64 } else { 0.0 };
        Place { left, right: (left + 1).min(from - 1), share }
    };
    (0..to).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weights of `from` samples in the sum over the first `counted` of `to`.
    fn counts(from: usize, to: usize, counted: usize) -> Vec<f64> {
        let mask = Mask::from_fn(to, 1, |x, _| x < counted);
        StageWeights::enlarged((from, 1), &mask).weights.into_iter().map(|weight| weight * counted as f64).collect()
    }

    fn enlarged_counts(from: usize, to: usize) -> Vec<f64> {
        counts(from, to, to)
    }

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

    /// Two samples enlarged to four lie at 0, 0.25, 0.75 and 1. A sample that no pixel of the mask looks at has no weight.
    #[test]
    fn counts_inside_a_mask() {
        assert_eq!(counts(2, 4, 1), [1.0, 0.0]);
        assert_eq!(counts(2, 4, 2), [1.75, 0.25]);
        assert_eq!(counts(2, 4, 3), [2.0, 1.0]);
        assert_eq!(counts(2, 4, 0), [0.0, 0.0]);
    }
}
