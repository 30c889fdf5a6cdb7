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
        let full = Picture::filled(20, 20, true);
        assert!(matches!(lpips.masked_from(&a, &strange, &full), Err(MetricError::FeaturesDiffer { .. })));
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

/// The mean over the mask of the enlarged maps, by its definition: every response computed, every map enlarged pixel by
/// pixel. `counts` are the pixels that are summed; `mask` fills the prediction.
fn masked_by_definition(
    lpips: &Lpips,
    prediction: &Picture<SrgbRgb>,
    reference: &Picture<SrgbRgb>,
    mask: &Mask,
    counts: &Mask,
) -> f64 {
    let filled = crate::mask::reference_filled(prediction, reference, mask).unwrap();
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

/// Masks of one block, of two, of scattered pixels, of everything. Summed over the whole picture instead, what spills out
/// of the mask is noticed.
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
        let found = lpips.masked(&p, &r, &mask).unwrap().unwrap();
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
    let found = lpips.black_fill(&p, &r, &mask).unwrap().unwrap();
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
        let filled = lpips.black_fill(&p, &r, &full).unwrap().unwrap();
        prop_assert!((filled - whole).abs() < 1e-9 * whole);
        prop_assert_eq!(lpips.masked(&p, &p, &full).unwrap(), Some(0.0));
    }
}
