//! Errors between noisy pictures are, on the average, those of the pictures without noise.

use mateval_image::LinearRgb;

use super::*;
use crate::mse;
use mateval_testkit::synthetic_noise::{
    Render, SCATTERS, Scatter, mean_and_deviation, mean_of, single_pixels, squares, waves,
};

const SIDE: usize = 24;
const SAMPLES: [u32; 3] = [4, 16, 64];

fn scaled(picture: &Picture<LinearRgb>, factor: f32) -> Picture<LinearRgb> {
    picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|value| value * factor)))
}

fn all() -> Mask {
    Picture::filled(SIDE, SIDE, true)
}

fn plain(scatter: Scatter, samples: u32) -> Render<'static> {
    Render { scatter, strength: 0.7, samples, blocks: None, view: 0 }
}

/// Two halves of a prediction and of a reference, each by the renders given.
struct Halved([Picture<LinearRgb>; 4]);

impl Halved {
    fn new(renders: [&Render; 2], truths: [&Picture<LinearRgb>; 2], seed: u64) -> Self {
        Self(std::array::from_fn(|i| renders[i / 2].picture(truths[i / 2], 4 * seed + i as u64)))
    }

    fn error(&self, blocks: &Picture<u32>) -> NoiseFreeMse {
        let [a, b, ia, ib] = &self.0;
        noise_free_mse(Halves { a, b }, Halves { a: ia, b: ib }, &all(), blocks).unwrap().unwrap()
    }

    /// The error of the halves' means, including noise.
    fn plain_error(&self) -> f64 {
        let [a, b, ia, ib] = &self.0;
        mse(&mean_of(a, b), &mean_of(ia, ib), None).unwrap().unwrap()
    }
}

/// Computed by hand: X = (0.5, 0.25), Y = (0.25, 0.25), so X Y = (0.125, 0.0625) and D = (0.09375, 0).
#[test]
fn a_small_number_by_hand() {
    let picture = |values: [f32; 2]| Picture::new(2, 1, values.to_vec()).unwrap();
    let (a, b, i) = (picture([1.0, 0.5]), picture([0.75, 0.5]), picture([0.5, 0.25]));
    let blocks = Picture::new(2, 1, vec![7, 3]).unwrap();
    let error = |mask: [bool; 2]| {
        let mask = Picture::new(2, 1, mask.to_vec()).unwrap();
        noise_free_mse(Halves { a: &a, b: &b }, Halves { a: &i, b: &i }, &mask, &blocks).unwrap()
    };
    let found = error([true, true]).unwrap();
    assert_eq!((found.mse, found.pixels), (0.09375, 2));
    assert_eq!(
        found.blocks.iter().map(|(id, noise)| (*id, noise.total())).collect::<Vec<_>>(),
        [(3, 0.0), (7, 0.046875)]
    );
    assert_eq!((found.standard_error(), found.prediction_error(), found.reference_error()), (0.046875, 0.046875, 0.0));
    assert_eq!(error([false, true]).unwrap().mse, 0.0625);
    assert_eq!(error([false, false]), None);
}

#[test]
fn what_does_not_fit_is_refused() {
    let (good, wide) = (Picture::filled(2, 2, 0.5_f32), Picture::filled(3, 2, 0.5_f32));
    let mut bad = good.clone();
    bad.set(1, 0, f32::NAN);
    let (mask, ids) = (Picture::filled(2, 2, true), Picture::filled(2, 2, 0));
    let both = |picture| Halves { a: picture, b: picture };
    let error = |p, r, ids| noise_free_mse(p, r, &mask, ids).unwrap_err();
    let halves = Halves { a: &good, b: &bad };
    assert!(matches!(
        error(both(&good), halves, &ids),
        MetricError::NotFinite { picture: "reference's second half", x: 1, y: 0, .. }
    ));
    assert!(matches!(error(halves, both(&good), &ids), MetricError::NotFinite { .. }));
    assert!(matches!(error(both(&good), both(&wide), &ids), MetricError::SizesDiffer { .. }));
    let blocks = Picture::filled(2, 1, 0);
    assert!(matches!(
        error(both(&good), both(&good), &blocks),
        MetricError::SizesDiffer { what: "picture of blocks", .. }
    ));
    let left = Picture::from_fn(2, 2, |x, _| x == 0);
    assert!(noise_free_mse(halves, both(&good), &left, &ids).unwrap().is_some());
}

/// A Z-test over 300 seeds; the error of the mean pictures fails it.
#[test]
fn the_estimate_has_no_bias() {
    let reference = waves(SIDE);
    let prediction = scaled(&reference, 0.8);
    let truth = mse(&prediction, &reference, None).unwrap().unwrap();
    let z = |values: &[f64]| {
        let (mean, deviation) = mean_and_deviation(values);
        (mean - truth) / (deviation / (values.len() as f64).sqrt())
    };
    for (scatter, samples) in SCATTERS.into_iter().flat_map(|scatter| SAMPLES.map(|samples| (scatter, samples))) {
        let render = plain(scatter, samples);
        let halved: Vec<_> = (0..300).map(|seed| Halved::new([&render; 2], [&prediction, &reference], seed)).collect();
        let free: Vec<f64> = halved.iter().map(|halved| halved.error(&single_pixels(SIDE)).mse).collect();
        assert!(z(&free).abs() < 3.5, "{scatter:?} {samples}: z = {}", z(&free));
        let noisy: Vec<f64> = halved.iter().map(Halved::plain_error).collect();
        assert!(samples > 4 || z(&noisy) > 20.0, "{scatter:?} {samples}: z = {} for the twin", z(&noisy));
    }
}

/// The ratio of the reported standard errors to the true spread of the estimates.
fn reported_over_true(errors: &[f64], estimates: &[f64]) -> f64 {
    let root = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
    root / mean_and_deviation(estimates).1
}

#[test]
fn the_standard_error_is_the_spread() {
    let reference = waves(SIDE);
    let prediction = scaled(&reference, 0.8);
    let (blocks, single) = (squares(SIDE, 0), single_pixels(SIDE));
    for (scatter, samples) in SCATTERS.into_iter().flat_map(|scatter| SAMPLES.map(|samples| (scatter, samples))) {
        for correlated in [false, true] {
            let render = Render { blocks: correlated.then_some(&blocks), ..plain(scatter, samples) };
            let halved: Vec<_> =
                (0..300).map(|seed| Halved::new([&render; 2], [&prediction, &reference], seed)).collect();
            let found = |ids: &Picture<u32>| {
                let errors: Vec<_> = halved.iter().map(|halved| halved.error(ids)).collect();
                let reported: Vec<f64> = errors.iter().map(NoiseFreeMse::standard_error).collect();
                reported_over_true(&reported, &errors.iter().map(|error| error.mse).collect::<Vec<_>>())
            };
            let ratio = found(if correlated { &blocks } else { &single });
            assert!((0.8..1.25).contains(&ratio), "{scatter:?} {samples} {correlated}: {ratio}");
            // The twin: correlated noise treated as if it were not correlated.
            assert!(!correlated || found(&single) < 0.7);
        }
    }
}

/// Two views that share blocks; their mean PSNR.
#[test]
fn the_error_of_a_mean_psnr_is_its_spread() {
    let references = [waves(SIDE), scaled(&waves(SIDE), 0.9)];
    let (blocks, others) = (squares(SIDE, 0), squares(SIDE, 1000));
    for (scatter, samples) in SCATTERS.into_iter().flat_map(|scatter| [16, 64].map(|samples| (scatter, samples))) {
        let halved = |view: usize, seed| {
            let render = Render { blocks: Some(&blocks), view: view as u64, ..plain(scatter, samples) };
            let prediction = scaled(&references[view], 0.4);
            Halved::new([&render; 2], [&prediction, &references[view]], seed)
        };
        let pairs: Vec<_> = (0..200).map(|seed| [halved(0, seed), halved(1, seed)]).collect();
        let found = |second: &Picture<u32>| {
            let (mut reported, mut means) = (Vec::new(), Vec::new());
            for [first, other] in &pairs {
                let views = [first.error(&blocks), other.error(second)];
                reported.push(psnr_mean_error(&[&views[0], &views[1]]).unwrap().total);
                means.push(views.iter().map(|view| view.psnr().unwrap().db).sum::<f64>() / 2.0);
            }
            reported_over_true(&reported, &means)
        };
        let (ratio, twin) = (found(&blocks), found(&others));
        assert!((0.8..1.25).contains(&ratio), "{scatter:?} {samples}: {ratio}");
        // The twin: views treated as if they shared no block.
        assert!(twin < 0.8 * ratio && (samples < 64 || twin < 0.8), "{scatter:?} {samples}: {twin} for the twin");
    }
}

/// Sums run in one order: a pool of any size gives the same bits.
#[test]
fn the_thread_count_changes_no_bit() {
    let reference = waves(SIDE);
    let render = plain(Scatter::HeavyTailed, 4);
    let halved = Halved::new([&render; 2], [&scaled(&reference, 0.8), &reference], 0);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| halved.error(&squares(SIDE, 0)))
    };
    assert_eq!(with(1), with(2));
    assert_ne!(with(1), Halved::new([&render; 2], [&scaled(&reference, 0.8), &reference], 1).error(&squares(SIDE, 0)));
}

/// The two sources of noise are separated: the picture with fewer samples has more noise, and both squares add up to
/// the square of the whole.
#[test]
fn whose_noise_it_is() {
    let reference = waves(SIDE);
    let prediction = scaled(&reference, 0.8);
    for scatter in SCATTERS {
        let (few, many) = (plain(scatter, 16), plain(scatter, 144));
        for (renders, ratio) in [([&few, &many], 3.0), ([&many, &few], 1.0 / 3.0)] {
            let errors: Vec<_> = (0..50)
                .map(|seed| Halved::new(renders, [&prediction, &reference], seed).error(&single_pixels(SIDE)))
                .collect();
            let square = |part: fn(&NoiseFreeMse) -> f64| errors.iter().map(|error| part(error).powi(2)).sum::<f64>();
            let (p, r) = (square(NoiseFreeMse::prediction_error), square(NoiseFreeMse::reference_error));
            let found = (p / r).sqrt();
            // The prediction is darker, so its noise is smaller.
            assert!((0.6..1.1).contains(&(found / ratio)), "{scatter:?}: {found}");
            assert!(((p + r) / square(NoiseFreeMse::standard_error) - 1.0).abs() < 0.05);
        }
    }
}

fn error_of(mse: f64, noise: f64) -> NoiseFreeMse {
    NoiseFreeMse { mse, pixels: 1, blocks: vec![(0, BlockNoise { prediction: noise, reference: 0.0 })] }
}

#[test]
fn psnr_of_an_estimate() {
    let psnr = |mse, noise| error_of(mse, noise).psnr().unwrap();
    let plain = |db| NoiseFreePsnr { db, exact: false, lower_bound: false };
    assert_eq!(psnr(0.01, 0.0), plain(Psnr::from_mse(0.01).unwrap().db));
    assert_eq!(psnr(0.01, 0.006), plain(Psnr::from_mse(0.01).unwrap().db));
    assert_eq!(psnr(0.0, 0.0), NoiseFreePsnr { db: 100.0, exact: true, lower_bound: false });
    assert_eq!(psnr(1e-20, 0.0), plain(100.0));
    // Not significant: 0.01 + 1.645 * 0.01.
    for (mse, noise, bound) in
        [(0.01, 0.01, 0.02645), (0.0, 0.01, 0.01645), (-0.01, 0.01, 0.01645), (-0.02, 0.01, 0.02)]
    {
        let found = psnr(mse, noise);
        assert!(found.lower_bound && !found.exact);
        assert!((found.db + 10.0 * libm::log10(bound)).abs() < 1e-9, "{mse}: {}", found.db);
    }
    assert_eq!(psnr(-1e-20, 1e-20), NoiseFreePsnr { db: 100.0, exact: false, lower_bound: true });
    assert!(matches!(error_of(f64::NAN, 0.0).psnr(), Err(MetricError::InvalidMse { .. })));
}

/// Computed by hand: 10 / ln 10 * 0.002 / 0.01 is 0.86859 dB. Two equal views that share their block have the same
/// error, two that do not have it divided by the root of 2.
#[test]
fn mean_psnr_errors_by_hand() {
    let (view, mut other) = (error_of(0.01, 0.002), error_of(0.01, 0.002));
    let total = |views: &[&NoiseFreeMse]| psnr_mean_error(views).map(|error| error.total);
    let one = total(&[&view]).unwrap();
    assert!((one - 0.868_588_96).abs() < 1e-8);
    assert!((total(&[&view, &other]).unwrap() - one).abs() < 1e-15);
    other.blocks[0].0 = 1;
    assert!((total(&[&view, &other]).unwrap() - one / 2.0_f64.sqrt()).abs() < 1e-15);
    assert_eq!(psnr_mean_error(&[&view]).unwrap().reference, 0.0);
    assert_eq!(total(&[]), None);
    assert_eq!(total(&[&view, &error_of(0.0, 0.002)]), None);
}
