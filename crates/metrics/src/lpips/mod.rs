//! LPIPS v0.1: the distance between two pictures in the features of a trained network.
//!
//! Zhang, Isola, Efros, Shechtman, Wang: "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric",
//! 2018, as in version 0.1 of their code. The picture in -1..1 is shifted and scaled per channel and runs through the
//! convolutions of AlexNet or VGG-16; after each of five stages the channels of every pixel are normalised to unit
//! length. The distance is the mean over a stage's pixels of the weighted squared differences, summed over the stages.
//! Lower is better: 0 for equal pictures, rarely above 1. Pictures are sRGB-encoded, in 0..1.
//!
//! Convolutions are matrix products in `f32`, in blocks that do not depend on the number of threads: one machine gives
//! the same bits with any number. Processors with other vector units may differ in the last digits.

mod network;
mod tensor;

use std::path::Path;

use mateval_image::{Mask, Picture, SrgbRgb};
use rayon::prelude::*;

use crate::MetricError;
use crate::pixel::{Size, check_finite, check_pair, check_size, pixel_count, size_of};
pub use network::{EPSILON, Features, Net, SCALE, SHIFT};
use network::{Network, Responses};
use tensor::{PixelSet, Tensor};

/// A network with its weights, ready to compare pictures.
///
/// While [`Lpips::features`] runs it takes, beside the picture, about 0.1 kB a pixel for Alex, 0.6 kB for VGG, plus a
/// few MB a thread. The resulting [`Features`] take 0.05 kB a pixel for Alex, 0.5 kB for VGG.
#[derive(Debug)]
pub struct Lpips {
    net: Net,
    sha256: String,
    network: Network,
}

impl Lpips {
    /// Reads the weights that `mateval fetch lpips` wrote.
    ///
    /// Fails if the file cannot be read, its hash is not the expected one, or it does not fit the network.
    pub fn load(net: Net, path: &Path) -> Result<Self, MetricError> {
        let (network, sha256) = network::load(net, path)?;
        Ok(Self { net, sha256, network })
    }

    pub fn net(&self) -> Net {
        self.net
    }

    /// The SHA-256 of the weights file, in lower-case hexadecimal.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// The distance over whole pictures.
    ///
    /// Fails if sizes differ, a side is below [`Net::least_side`] or a value is not finite.
    pub fn whole(&self, prediction: &Picture<SrgbRgb>, reference: &Picture<SrgbRgb>) -> Result<f64, MetricError> {
        check_pair(prediction, reference, None)?;
        self.distance(&self.features(prediction)?, &self.features(reference)?)
    }

    /// [`Lpips::whole`] of both pictures with black outside the mask (protocol `paper`), from the features of the
    /// reference with black there. The larger the black part, the nearer the result is to 0. `None` where no pixel
    /// counts. Fails as [`Lpips::whole`] does.
    pub fn black_fill(
        &self,
        prediction: &Picture<SrgbRgb>,
        reference: &Features,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        self.filled_distance(prediction, reference, mask, || {
            StageWeights::of_mean(&self.network, (mask.width(), mask.height()))
        })
    }

    /// The mean over the mask (protocol `mateval-3`): the prediction's pixels outside the mask are replaced by the
    /// reference's, each stage's map of distances is enlarged bilinearly to the picture's size, and the sum of the maps
    /// is averaged over the pixels of the mask. `None` where no pixel counts. The prediction is not read outside the
    /// mask, the reference is. Fails as [`Lpips::whole`] does.
    pub fn inside(
        &self,
        prediction: &Picture<SrgbRgb>,
        reference: &Features,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        self.filled_distance(prediction, reference, mask, || StageWeights::inside(&self.network, mask))
    }

    /// The weighted distance of the reference from itself with the prediction's pixels inside the mask. The networks
    /// run over those parts of the picture alone that these pixels change and the weights count. `None` where no pixel
    /// counts.
    fn filled_distance(
        &self,
        prediction: &Picture<SrgbRgb>,
        reference: &Features,
        mask: &Mask,
        weights: impl FnOnce() -> Vec<StageWeights>,
    ) -> Result<Option<f64>, MetricError> {
        network::check_reference(self.net, reference, size_of(prediction))?;
        check_size(size_of(prediction), "mask", size_of(mask))?;
        check_finite("prediction", prediction, Some(mask))?;
        if pixel_count(mask) == 0 {
            return Ok(None);
        }
        let input = network::filled_input(prediction, reference, mask);
        Ok(Some(weighted(&self.network, &input, reference, &weights())))
    }

    /// The network's features of a picture. Those of a reference serve every prediction.
    ///
    /// Fails if a side is below [`Net::least_side`] or a value is not finite.
    pub fn features(&self, picture: &Picture<SrgbRgb>) -> Result<Features, MetricError> {
        network::compute(self.net, &self.network, picture)
    }

    /// [`Lpips::whole`] of two pictures from their features. Fails if networks or sizes differ.
    pub fn distance(&self, prediction: &Features, reference: &Features) -> Result<f64, MetricError> {
        network::check_pair(self.net, prediction, reference)?;
        Ok(mean(&self.network, prediction, reference))
    }
}

/// How much each pixel of a stage counts, row by row.
struct StageWeights {
    size: Size,
    weights: Vec<f64>,
}

/// The sum over stages of the mean over the stage's pixels.
fn mean(network: &Network, prediction: &Features, reference: &Features) -> f64 {
    let stages = network.stages.iter().zip(prediction.stages.iter().zip(&reference.stages));
    let means = stages.map(|(stage, (p, r))| {
        let distances = distances(&stage.linear, p, r, &(0..p.pixels()).collect::<Vec<_>>());
        distances.iter().sum::<f64>() / distances.len() as f64
    });
    means.sum()
}

/// The sum over stages and pixels of the distance of a picture, given as the network's input, from `reference`, times
/// the weights. Only responses in which the two may differ are computed.
fn weighted(network: &Network, input: &Tensor, reference: &Features, weights: &[StageWeights]) -> f64 {
    let needed: Vec<PixelSet> = weights.iter().map(StageWeights::counted).collect();
    let changed = network::compute_changed(network, input, reference, &needed);
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
    fn of_mean(network: &Network, picture: Size) -> Vec<Self> {
        let even = |size: Size| Self { size, weights: vec![1.0 / (size.0 * size.1) as f64; size.0 * size.1] };
        network::stage_sizes(network, picture).into_iter().map(even).collect()
    }

    /// For the mean over the mask of the stages' maps, each enlarged bilinearly to the picture's size. The enlarged
    /// maps are not computed: their sum is a weighted sum of the stage's values.
    fn inside(network: &Network, mask: &Mask) -> Vec<Self> {
        let picture = (mask.width(), mask.height());
        network::stage_sizes(network, picture).into_iter().map(|size| Self::enlarged(size, mask)).collect()
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

/// The places of `to` samples interpolated linearly between `from`, with pixel centres at one half and the ends
/// continued (torch's `bilinear` with `align_corners=False`).
fn enlarged_places(from: usize, to: usize) -> Vec<Place> {
    let place = |target: usize| {
        let position = ((target as f64 + 0.5) * from as f64 / to as f64 - 0.5).max(0.0);
        let left = (position as usize).min(from - 1);
        let share = if left + 1 < from { position - left as f64 } else { 0.0 };
        Place { left, right: (left + 1).min(from - 1), share }
    };
    (0..to).map(place).collect()
}

/// LPIPS on tiny random networks, which need no weights file.
#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::lpips::network::{Stage, StageShape};
    use crate::lpips::tensor::{Convolution, Pool, Shape};
    use crate::mask_rule::MaskRule::{BlackFill, Inside};
    use crate::mask_rule::{MaskRule, ReferenceFeatures};
    use crate::pixel::{black_filled, reference_filled};

    /// Pseudorandom values in -0.5..0.5.
    fn random(count: usize, seed: u64) -> Vec<f32> {
        let mut state = seed.wrapping_mul(2) | 1;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1_u64 << 24) as f32 - 0.5
        };
        (0..count).map(|_| next()).collect()
    }

    /// A network with random weights. Linear weights are not negative, as in the real networks.
    fn random_network(shapes: &[StageShape], seed: u64) -> Network {
        let mut seed = seed;
        let mut values = |count| {
            seed += 1;
            random(count, seed)
        };
        let mut stages = Vec::new();
        for shape in shapes {
            let mut convolutions = Vec::new();
            for &shape in &shape.convolutions {
                let weights = values(shape.patch() * shape.outputs);
                convolutions.push(Convolution::new(shape, &weights, values(shape.outputs)));
            }
            let channels = shape.convolutions.last().unwrap().outputs;
            let linear = values(channels).into_iter().map(f32::abs).collect();
            stages.push(Stage { pool: shape.pool, convolutions, linear });
        }
        Network { stages }
    }

    /// Two stages, with strides 2 and 1 and a pool between them.
    fn tiny() -> Lpips {
        let shape = |kernel, stride, inputs, outputs| Shape { kernel, stride, padding: 1, inputs, outputs };
        let shapes = [
            StageShape { pool: None, convolutions: vec![shape(3, 2, 3, 8)] },
            StageShape {
                pool: Some(Pool { window: 2, stride: 2 }),
                convolutions: vec![shape(3, 1, 8, 6), shape(3, 1, 6, 5)],
            },
        ];
        Lpips { net: Net::Alex, sha256: String::new(), network: random_network(&shapes, 1) }
    }

    fn noise(width: usize, height: usize, seed: u64) -> Picture<SrgbRgb> {
        let values = random(3 * width * height, seed);
        Picture::from_fn(width, height, |x, y| SrgbRgb(std::array::from_fn(|c| values[3 * (y * width + x) + c] + 0.5)))
    }

    fn masked(
        lpips: &Lpips,
        rule: MaskRule,
        prediction: &Picture<SrgbRgb>,
        reference: &Picture<SrgbRgb>,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        rule.lpips(lpips, prediction, reference, &ReferenceFeatures::default(), mask)
    }

    /// The metric equals its definition, computed in `f64` from the same features.
    #[test]
    fn the_distance_by_its_definition() {
        let (lpips, p, r) = (tiny(), noise(17, 14, 1), noise(17, 14, 2));
        let (fp, fr) = (lpips.features(&p).unwrap(), lpips.features(&r).unwrap());
        let mut expected = 0.0;
        for (index, stage) in lpips.network.stages.iter().enumerate() {
            let (a, b) = (&fp.stages[index], &fr.stages[index]);
            let mut sum = 0.0;
            for pixel in 0..a.pixels() {
                let length: f64 = a.normalized(pixel).map(|v| f64::from(v).powi(2)).sum();
                assert!(length == 0.0 || (length - 1.0).abs() < 1e-6);
                let pairs = stage.linear.iter().zip(a.normalized(pixel).zip(b.normalized(pixel)));
                sum += pairs.map(|(&w, (a, b))| f64::from(w) * (f64::from(a) - f64::from(b)).powi(2)).sum::<f64>();
            }
            expected += sum / a.pixels() as f64;
        }
        assert!(expected > 0.01);
        assert!((lpips.whole(&p, &r).unwrap() - expected).abs() < 1e-12);
        assert!((lpips.distance(&fp, &fr).unwrap() - expected).abs() < 1e-12);
    }

    #[test]
    fn features_of_other_networks_and_sizes_are_refused() {
        let (lpips, other) = (tiny(), Lpips { net: Net::Vgg, ..tiny() });
        let (a, b) = (noise(20, 20, 8), noise(20, 21, 9));
        let features = lpips.features(&a).unwrap();
        for strange in [other.features(&a).unwrap(), lpips.features(&b).unwrap()] {
            assert!(matches!(lpips.distance(&strange, &features), Err(MetricError::FeaturesDiffer { .. })));
            let full = Picture::filled(20, 20, true);
            assert!(matches!(lpips.inside(&a, &strange, &full), Err(MetricError::FeaturesDiffer { .. })));
        }
        assert!(matches!(lpips.whole(&a, &b), Err(MetricError::SizesDiffer { .. })));
    }

    #[test]
    fn values_outside_the_mask() {
        let (lpips, p, r) = (tiny(), noise(24, 18, 10), noise(24, 18, 11));
        let mask = Picture::from_fn(24, 18, |x, y| x > 6 && y < 12);
        let mut spoilt = p.clone();
        spoilt.set(3, 3, SrgbRgb([f32::NAN; 3]));
        spoilt.set(20, 15, SrgbRgb([1e9; 3]));
        // The prediction is not read.
        assert_eq!(masked(&lpips, Inside, &spoilt, &r, &mask).unwrap(), masked(&lpips, Inside, &p, &r, &mask).unwrap());
        assert_eq!(masked(&lpips, BlackFill, &spoilt, &spoilt, &mask).unwrap(), Some(0.0));
        let error = lpips.whole(&spoilt, &r).unwrap_err();
        assert!(matches!(error, MetricError::NotFinite { picture: "prediction", x: 3, y: 3, .. }));
        // The reference is, by the rule that fills the prediction with it.
        let error = masked(&lpips, Inside, &p, &spoilt, &mask).unwrap_err();
        assert!(matches!(error, MetricError::NotFinite { picture: "picture", .. }));
        // Where nothing counts, there is no value.
        let none = Picture::filled(24, 18, false);
        assert_eq!(masked(&lpips, Inside, &p, &r, &none).unwrap(), None);
        assert_eq!(masked(&lpips, BlackFill, &p, &r, &none).unwrap(), None);
    }

    #[test]
    fn the_thread_count_changes_no_bit() {
        let (lpips, p, r) = (tiny(), noise(97, 61, 12), noise(97, 61, 13));
        let mask = Picture::from_fn(97, 61, |x, y| (x + y) % 5 > 1);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let both = || (lpips.whole(&p, &r).unwrap(), masked(&lpips, Inside, &p, &r, &mask).unwrap().unwrap());
            let (whole, masked) = pool.install(both);
            (whole.to_bits(), masked.to_bits())
        };
        assert_eq!(with(1), with(2));
        assert_eq!(with(1), with(4));
    }

    /// The mean over the mask of the enlarged maps, by its definition: every response computed, every map enlarged
    /// pixel by pixel. `counts` are the pixels that are summed; `mask` fills the prediction.
    fn masked_by_definition(
        lpips: &Lpips,
        prediction: &Picture<SrgbRgb>,
        reference: &Picture<SrgbRgb>,
        mask: &Mask,
        counts: &Mask,
    ) -> f64 {
        let filled = reference_filled(prediction, reference, mask).unwrap();
        let (fp, fr) = (lpips.features(&filled).unwrap(), lpips.features(reference).unwrap());
        let mut sum = 0.0;
        for (stage, (p, r)) in lpips.network.stages.iter().zip(fp.stages.iter().zip(&fr.stages)) {
            let (width, height) = (p.tensor.width, p.tensor.height);
            let map = |x: usize, y: usize| -> f64 {
                let pairs = p.normalized(y * width + x).zip(r.normalized(y * width + x));
                stage
                    .linear
                    .iter()
                    .zip(pairs)
                    .map(|(&w, (p, r))| f64::from(w) * (f64::from(p) - f64::from(r)).powi(2))
                    .sum()
            };
            let place = |at: usize, from: usize, to: usize| {
                let position = ((at as f64 + 0.5) * from as f64 / to as f64 - 0.5).clamp(0.0, (from - 1) as f64);
                (position as usize, (position as usize + 1).min(from - 1), position.fract())
            };
            for (y, x) in (0..mask.height()).flat_map(|y| (0..mask.width()).map(move |x| (y, x))) {
                if counts.get(x, y) {
                    let (left, right, across) = place(x, width, mask.width());
                    let (top, bottom, down) = place(y, height, mask.height());
                    let row = |y: usize| map(left, y) * (1.0 - across) + map(right, y) * across;
                    sum += row(top) * (1.0 - down) + row(bottom) * down;
                }
            }
        }
        sum / pixel_count(mask) as f64
    }

    /// Masks of one block, of two, of scattered pixels, of everything. Summed over the whole picture instead, what
    /// spills out of the mask is noticed.
    #[test]
    fn inside_a_mask_by_its_definition() {
        let (lpips, p, r) = (tiny(), noise(40, 34, 40), noise(40, 34, 41));
        let masks: [fn(usize, usize) -> bool; 4] = [
            |x, y| x > 21 && y < 9,
            |x, y| x < 4 && y < 5 || x > 33 && y > 30,
            |x, y| (7 * x + 5 * y) % 61 == 0,
            |_, _| true,
        ];
        let everything = Picture::filled(40, 34, true);
        for (at, mask) in masks.into_iter().enumerate() {
            let mask = Picture::from_fn(40, 34, mask);
            let found = masked(&lpips, Inside, &p, &r, &mask).unwrap().unwrap();
            let expected = masked_by_definition(&lpips, &p, &r, &mask, &mask);
            assert!((found - expected).abs() < 1e-6 * expected, "{at}: {found} {expected}");
            let spilt = masked_by_definition(&lpips, &p, &r, &mask, &everything);
            assert!(at == 3 || spilt > 1.05 * found, "{at}: {found} {spilt}");
        }
    }

    /// Black outside the mask: what is left out of the computation is what both pictures have in common.
    #[test]
    fn black_fill_by_its_definition() {
        let (lpips, p, r) = (tiny(), noise(40, 34, 42), noise(40, 34, 43));
        let mask = Picture::from_fn(40, 34, |x, y| x > 21 && y < 9 || x + y < 8);
        let found = masked(&lpips, BlackFill, &p, &r, &mask).unwrap().unwrap();
        let whole = lpips.whole(&black_filled(&p, &mask).unwrap(), &black_filled(&r, &mask).unwrap()).unwrap();
        assert!((found - whole).abs() < 1e-6 * whole, "{found} {whole}");
        assert!((found - lpips.whole(&p, &r).unwrap()).abs() > 0.1 * whole);
    }

    /// The least sides follow from the real layers: with one pixel less, a stage has no pixel.
    #[test]
    fn least_sides_of_the_real_networks() {
        for net in [Net::Alex, Net::Vgg] {
            let network = random_network(&net.stages(), 14);
            assert!(network.fits(net.least_side()) && !network.fits(net.least_side() - 1));
            let lpips = Lpips { net, sha256: String::new(), network };
            let least = net.least_side();
            assert_eq!(lpips.features(&noise(least, least, 15)).unwrap().stages.len(), 5);
            let error = lpips.features(&noise(least, least - 1, 15)).unwrap_err();
            assert!(matches!(error, MetricError::TooSmall { least: found, .. } if found == least), "{error}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn identity_symmetry_and_full_mask(width in 8_usize..40, height in 8_usize..40, seed: u32) {
            let (lpips, seed) = (tiny(), u64::from(seed));
            let (p, r) = (noise(width, height, seed), noise(width, height, seed + 1));
            let full = Picture::filled(width, height, true);
            let whole = lpips.whole(&p, &r).unwrap();
            prop_assert_eq!(lpips.whole(&p, &p).unwrap(), 0.0);
            prop_assert!(whole > 0.0);
            prop_assert_eq!(lpips.whole(&r, &p).unwrap(), whole);
            let filled = masked(&lpips, BlackFill, &p, &r, &full).unwrap().unwrap();
            prop_assert!((filled - whole).abs() < 1e-9 * whole);
            prop_assert_eq!(masked(&lpips, Inside, &p, &p, &full).unwrap(), Some(0.0));
        }
    }

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

    /// Two samples enlarged to four lie at 0, 0.25, 0.75 and 1. A sample that no pixel of the mask looks at has no
    /// weight.
    #[test]
    fn counts_inside_a_mask() {
        assert_eq!(counts(2, 4, 1), [1.0, 0.0]);
        assert_eq!(counts(2, 4, 2), [1.75, 0.25]);
        assert_eq!(counts(2, 4, 3), [2.0, 1.0]);
        assert_eq!(counts(2, 4, 0), [0.0, 0.0]);
    }
}
