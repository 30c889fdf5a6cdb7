//! Tests of LPIPS on tiny random networks, which need no weights file.

use proptest::prelude::*;

use super::convolution::{Convolution, Shape};
use super::net::{Stage, StageShape};
use super::pool::Pool;
use super::*;

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

/// The metric equals its definition, computed in `f64` from the same features.
#[test]
fn the_distance_by_its_definition() {
    let (lpips, p, r) = (tiny(), noise(17, 14, 1), noise(17, 14, 2));
    let (fp, fr) = (lpips.features(&p).unwrap(), lpips.features(&r).unwrap());
    let mut expected = 0.0;
    for (index, stage) in lpips.network.stages.iter().enumerate() {
        let (a, b) = (&fp.stages[index], &fr.stages[index]);
        for pixel in a.values.chunks(a.channels) {
            let length: f64 = pixel.iter().map(|&v| f64::from(v).powi(2)).sum();
            assert!(length == 0.0 || (length - 1.0).abs() < 1e-6);
        }
        let mut sum = 0.0;
        for (i, (&a, &b)) in a.values.iter().zip(&b.values).enumerate() {
            sum += f64::from(stage.linear[i % stage.linear.len()]) * (f64::from(a) - f64::from(b)).powi(2);
        }
        expected += sum / (a.width * a.height) as f64;
    }
    assert!(expected > 0.01);
    assert!((lpips.whole(&p, &r).unwrap() - expected).abs() < 1e-12);
    assert!((lpips.distance(&fp, &fr).unwrap() - expected).abs() < 1e-12);
}

#[test]
fn features_of_the_reference_serve_several_predictions() {
    let (lpips, r) = (tiny(), noise(20, 20, 3));
    let reference = lpips.features(&r).unwrap();
    for seed in 4..7 {
        let p = noise(20, 20, seed);
        let found = lpips.distance(&lpips.features(&p).unwrap(), &reference).unwrap();
        assert_eq!(found, lpips.whole(&p, &r).unwrap());
    }
}

#[test]
fn features_of_other_networks_and_sizes_are_refused() {
    let (lpips, other) = (tiny(), Lpips { net: Net::Vgg, ..tiny() });
    let (a, b) = (noise(20, 20, 8), noise(20, 21, 9));
    let features = lpips.features(&a).unwrap();
    for strange in [other.features(&a).unwrap(), lpips.features(&b).unwrap()] {
        assert!(matches!(lpips.distance(&strange, &features), Err(MetricError::FeaturesDiffer { .. })));
        assert!(matches!(lpips.masked_distance(&features, &strange, 9), Err(MetricError::FeaturesDiffer { .. })));
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
    assert_eq!(lpips.masked(&spoilt, &r, &mask).unwrap(), lpips.masked(&p, &r, &mask).unwrap());
    assert_eq!(lpips.black_fill(&spoilt, &spoilt, &mask).unwrap(), Some(0.0));
    let error = lpips.whole(&spoilt, &r).unwrap_err();
    assert!(matches!(error, MetricError::NotFinite { picture: "prediction", x: 3, y: 3, .. }));
    // The reference is, by the rule that fills the prediction with it.
    let error = lpips.masked(&p, &spoilt, &mask).unwrap_err();
    assert!(matches!(error, MetricError::NotFinite { picture: "reference", .. }));
    // Where nothing counts, there is no value.
    let none = Picture::filled(24, 18, false);
    assert_eq!(lpips.masked(&p, &r, &none).unwrap(), None);
    assert_eq!(lpips.black_fill(&p, &r, &none).unwrap(), None);
}

#[test]
fn the_thread_count_changes_no_bit() {
    let (lpips, p, r) = (tiny(), noise(97, 61, 12), noise(97, 61, 13));
    let mask = Picture::from_fn(97, 61, |x, y| (x + y) % 5 > 1);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let both = || (lpips.whole(&p, &r).unwrap(), lpips.masked(&p, &r, &mask).unwrap().unwrap());
        let (whole, masked) = pool.install(both);
        (whole.to_bits(), masked.to_bits())
    };
    assert_eq!(with(1), with(2));
    assert_eq!(with(1), with(4));
}

/// The extrapolation equals its definition under both mask rules.
#[test]
fn the_extrapolation_by_its_definition() {
    let (lpips, r) = (tiny(), noise(24, 18, 20));
    let mask = Picture::from_fn(24, 18, |x, y| x > 6 && y < 12);
    let [mean, mut a, b] = [21, 22, 23].map(|seed| noise(24, 18, seed));
    a.set(3, 3, SrgbRgb([f32::NAN; 3]));
    let noisy = MeanAndHalves { mean: &mean, a: &a, b: &b };
    let expected =
        |distance: &dyn Fn(&Picture<SrgbRgb>) -> f64| 2.0 * distance(&mean) - (distance(&a) + distance(&b)) / 2.0;
    let (whole, black) = (lpips.features(&r).unwrap(), lpips.black_filled_features(&r, &mask).unwrap());
    let found = lpips.extrapolated_masked(noisy, &r, &whole, &mask).unwrap().unwrap();
    assert_eq!(found.lpips, expected(&|p| lpips.masked(p, &r, &mask).unwrap().unwrap()));
    assert_eq!(found.lpips, 2.0 * found.of_mean - found.of_halves);
    let found = lpips.extrapolated_black_fill(noisy, &black, &mask).unwrap().unwrap();
    assert_eq!(found.lpips, expected(&|p| lpips.black_fill(p, &r, &mask).unwrap().unwrap()));
    // The twin: features of the other mask rule give another value.
    assert_ne!(lpips.extrapolated_black_fill(noisy, &whole, &mask).unwrap(), Some(found));
    let none = Picture::filled(24, 18, false);
    assert_eq!(lpips.extrapolated_masked(noisy, &r, &whole, &none).unwrap(), None);
    assert_eq!(lpips.extrapolated_black_fill(noisy, &black, &none).unwrap(), None);
    a.set(10, 3, SrgbRgb([f32::NAN; 3]));
    let error = lpips.extrapolated_black_fill(MeanAndHalves { mean: &mean, a: &a, b: &b }, &black, &mask).unwrap_err();
    assert!(matches!(error, MetricError::NotFinite { picture: "prediction's first half", x: 10, y: 3, .. }));
    let small = noise(18, 18, 24);
    let error =
        lpips.extrapolated_black_fill(MeanAndHalves { mean: &mean, a: &b, b: &small }, &black, &mask).unwrap_err();
    assert!(matches!(error, MetricError::SizesDiffer { what: "prediction's second half", .. }));
}

/// Without noise the extrapolation changes nothing.
#[test]
fn equal_halves_are_plain_lpips() {
    let (lpips, p, r, mask) = (tiny(), noise(20, 20, 25), noise(20, 20, 26), Picture::from_fn(20, 20, |x, _| x > 4));
    let same = MeanAndHalves { mean: &p, a: &p, b: &p };
    let found = lpips.extrapolated_masked(same, &r, &lpips.features(&r).unwrap(), &mask).unwrap().unwrap();
    assert_eq!(Some(found.lpips), lpips.masked(&p, &r, &mask).unwrap());
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
        prop_assert_eq!(lpips.black_fill(&p, &r, &full).unwrap(), Some(whole));
        prop_assert_eq!(lpips.masked(&p, &p, &full).unwrap(), Some(0.0));
    }
}
