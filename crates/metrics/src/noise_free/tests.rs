//! Errors between noisy pictures are, on the average, those of the pictures without noise.

use mateval_image::LinearRgb;

use super::*;
use crate::{NoisyHalf, mse};
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

/// Four quarters of a prediction, of half the samples each, and two halves of a reference.
struct Rendered {
    prediction: NoisyRender<LinearRgb>,
    reference: [Picture<LinearRgb>; 2],
}

impl Rendered {
    fn new(renders: [&Render; 2], truths: [&Picture<LinearRgb>; 2], seed: u64) -> Self {
        let quarter = Render { samples: renders[0].samples / 2, ..*renders[0] };
        let half = |first: u64| linear_half([0, 1].map(|which| quarter.picture(truths[0], 6 * seed + first + which)));
        let prediction = NoisyRender { a: half(0), b: half(2), shared: None };
        Self { prediction, reference: [4, 5].map(|which| renders[1].picture(truths[1], 6 * seed + which)) }
    }

    fn error(&self, blocks: &Picture<u32>) -> NoiseFreeMse {
        let [a, b] = &self.reference;
        noise_free_mse(&self.prediction, Halves { a, b }, &all(), blocks).unwrap().unwrap()
    }

    /// The error of the halves' means, including noise.
    fn plain_error(&self) -> f64 {
        let ([ia, ib], NoisyRender { a, b, .. }) = (&self.reference, &self.prediction);
        mse(&mean_of(&a.estimate, &b.estimate), &mean_of(ia, ib), None).unwrap().unwrap()
    }
}

/// A half of two quarters, not encoded.
fn linear_half([first, second]: [Picture<LinearRgb>; 2]) -> NoisyHalf<LinearRgb> {
    let combined = |sign: f32| {
        let pairs = first.pixels().iter().zip(second.pixels());
        let pixels = pairs.map(|(a, b)| LinearRgb([0, 1, 2].map(|c| 0.5 * (a.0[c] + sign * b.0[c]))));
        Picture::new(first.width(), first.height(), pixels.collect()).unwrap()
    };
    NoisyHalf { estimate: combined(1.0), noise: combined(-1.0) }
}

/// A render whose halves and their noise are given.
fn render<P: Pixel>([a, u, b, v]: [&Picture<P>; 4]) -> NoisyRender<P> {
    let half =
        |estimate: &Picture<P>, noise: &Picture<P>| NoisyHalf { estimate: estimate.clone(), noise: noise.clone() };
    NoisyRender { a: half(a, u), b: half(b, v), shared: None }
}

/// Computed by hand: X = (0.5, 0.25), Y = (0.25, 0.25), so X Y = (0.125, 0.0625); u = (0.125, 0), v = (0.25, 0.125), so
/// Y u = (0.03125, 0), X v = (0.125, 0.03125), u v = (0.03125, 0). All sums are divided by 2.
#[test]
fn a_small_number_by_hand() {
    let picture = |values: [f32; 2]| Picture::new(2, 1, values.to_vec()).unwrap();
    let (a, b, i) = (picture([1.0, 0.5]), picture([0.75, 0.5]), picture([0.5, 0.25]));
    let (u, v) = (picture([0.125, 0.0]), picture([0.25, 0.125]));
    let blocks = Picture::new(2, 1, vec![7, 3]).unwrap();
    let error = |mask: [bool; 2]| {
        let mask = Picture::new(2, 1, mask.to_vec()).unwrap();
        noise_free_mse(&render([&a, &u, &b, &v]), Halves { a: &i, b: &i }, &mask, &blocks).unwrap()
    };
    let found = error([true, true]).unwrap();
    assert_eq!((found.mse, found.pixels), (0.09375, 2));
    let first = BlockNoise { second_half: 0.015625, ..Default::default() };
    let second = BlockNoise { first_half: 0.015625, second_half: 0.0625, both_halves: 0.015625, ..Default::default() };
    assert_eq!(found.blocks, [(3, first), (7, second)]);
    let paths = 0.015625_f64.powi(2) + 0.0625_f64.powi(2);
    let products = 0.015625_f64.powi(2);
    assert_eq!(found.variances(), Variances { paths, products, shared: 0.0, reference: 0.0, common: 0.0 });
    assert_eq!(found.standard_error(), paths.sqrt());
    // An error that all pixels have in common adds its square, and over views it adds before it is squared.
    let fitted = NoiseFreeMse { common: 0.25, ..found.clone() };
    assert_eq!(fitted.variances().total(), paths + 0.0625);
    let [one, two] = [&[&fitted][..], &[&fitted, &fitted][..]].map(|views| psnr_mean_error(views).unwrap().common);
    assert!((one - 10.0 / LN_10 * 0.25 / fitted.bounded()).abs() < 1e-12 && (one - two).abs() < 1e-12);
    assert_eq!(error([false, true]).unwrap().mse, 0.0625);
    assert_eq!(error([false, false]), None);
}

#[test]
fn what_does_not_fit_is_refused() {
    let (good, wide) = (Picture::filled(2, 2, 0.5_f32), Picture::filled(3, 2, 0.5_f32));
    let mut bad = good.clone();
    bad.set(1, 0, f32::NAN);
    let (mask, ids) = (Picture::filled(2, 2, true), Picture::filled(2, 2, 0));
    let sound = || render([&good; 4]);
    let both = |picture| Halves { a: picture, b: picture };
    let error = |p: &NoisyRender<f32>, r, ids| noise_free_mse(p, r, &mask, ids).unwrap_err();
    let halves = Halves { a: &good, b: &bad };
    assert!(matches!(
        error(&sound(), halves, &ids),
        MetricError::NotFinite { picture: "reference's second half", x: 1, y: 0, .. }
    ));
    for at in 0..4 {
        let mut pictures = [&good; 4];
        pictures[at] = &bad;
        assert!(matches!(error(&render(pictures), both(&good), &ids), MetricError::NotFinite { .. }), "{at}");
    }
    let shared = NoisyRender { shared: Some(wide.clone()), ..sound() };
    assert!(matches!(error(&shared, both(&good), &ids), MetricError::SizesDiffer { .. }));
    assert!(matches!(error(&sound(), both(&wide), &ids), MetricError::SizesDiffer { .. }));
    let blocks = Picture::filled(2, 1, 0);
    assert!(matches!(
        error(&sound(), both(&good), &blocks),
        MetricError::SizesDiffer { what: "picture of blocks", .. }
    ));
    let left = Picture::from_fn(2, 2, |x, _| x == 0);
    assert!(noise_free_mse(&sound(), halves, &left, &ids).unwrap().is_some());
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
        let rendered: Vec<_> =
            (0..300).map(|seed| Rendered::new([&render; 2], [&prediction, &reference], seed)).collect();
        let free: Vec<f64> = rendered.iter().map(|rendered| rendered.error(&single_pixels(SIDE)).mse).collect();
        assert!(z(&free).abs() < 3.5, "{scatter:?} {samples}: z = {}", z(&free));
        let noisy: Vec<f64> = rendered.iter().map(Rendered::plain_error).collect();
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
            let rendered: Vec<_> =
                (0..300).map(|seed| Rendered::new([&render; 2], [&prediction, &reference], seed)).collect();
            let found = |ids: &Picture<u32>| {
                let errors: Vec<_> = rendered.iter().map(|rendered| rendered.error(ids)).collect();
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

/// Two views that share blocks; their mean PSNR. References have four times the samples, as a dataset's have: two halves of
/// few heavy-tailed samples overstate their own noise.
#[test]
fn the_error_of_a_mean_psnr_is_its_spread() {
    let references = [waves(SIDE), scaled(&waves(SIDE), 0.9)];
    let (blocks, others) = (squares(SIDE, 0), squares(SIDE, 1000));
    for (scatter, samples) in SCATTERS.into_iter().flat_map(|scatter| [16, 64].map(|samples| (scatter, samples))) {
        let rendered = |view: usize, seed| {
            let render = Render { blocks: Some(&blocks), view: view as u64, ..plain(scatter, samples) };
            let reference = Render { samples: 4 * samples, ..render };
            let prediction = scaled(&references[view], 0.4);
            Rendered::new([&render, &reference], [&prediction, &references[view]], seed)
        };
        let pairs: Vec<_> = (0..200).map(|seed| [rendered(0, seed), rendered(1, seed)]).collect();
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
    let rendered = Rendered::new([&render; 2], [&scaled(&reference, 0.8), &reference], 0);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| rendered.error(&squares(SIDE, 0)))
    };
    assert_eq!(with(1), with(2));
    assert_ne!(
        with(1),
        Rendered::new([&render; 2], [&scaled(&reference, 0.8), &reference], 1).error(&squares(SIDE, 0))
    );
}

/// The sources of noise are separated: the picture with fewer samples has more noise. Noise that both quarters share is
/// found where it is stated, and lost where it is not.
#[test]
fn whose_noise_it_is() {
    let reference = waves(SIDE);
    let prediction = scaled(&reference, 0.8);
    for scatter in SCATTERS {
        let (few, many) = (plain(scatter, 16), plain(scatter, 144));
        for (renders, ratio) in [([&few, &many], 3.0), ([&many, &few], 1.0 / 3.0)] {
            let all: Vec<Variances> = (0..50)
                .map(|seed| {
                    Rendered::new(renders, [&prediction, &reference], seed).error(&single_pixels(SIDE)).variances()
                })
                .collect();
            let sum = |part: fn(&Variances) -> f64| all.iter().map(part).sum::<f64>();
            let found = (sum(|v| v.paths) / sum(|v| v.reference)).sqrt();
            // The prediction is darker, so its noise is smaller.
            assert!((0.6..1.35).contains(&(found / ratio)), "{scatter:?}: {found}");
            assert_eq!(sum(|v| v.shared), 0.0);
        }
    }
}

/// Each half has noise that both of its quarters share.
#[test]
fn shared_noise_counts() {
    let reference = waves(SIDE);
    let prediction = scaled(&reference, 0.8);
    let (paths, shared, fine) =
        (plain(Scatter::GaussianLike, 64), plain(Scatter::GaussianLike, 16), plain(Scatter::GaussianLike, 4096));
    let none = scaled(&prediction, 0.0);
    let rendered = |seed: u64| {
        let mut rendered = Rendered::new([&paths, &fine], [&prediction, &reference], seed);
        let noise = [0, 1].map(|half| difference(&shared.picture(&prediction, 100_000 + 2 * seed + half), &prediction));
        let NoisyRender { a, b, shared } = &mut rendered.prediction;
        a.estimate = difference(&a.estimate, &difference(&none, &noise[0]));
        b.estimate = difference(&b.estimate, &difference(&none, &noise[1]));
        *shared = Some(difference(&noise[0], &noise[1]));
        rendered
    };
    let all: Vec<Rendered> = (0..200).map(rendered).collect();
    let ratio = |reported: &dyn Fn(&NoiseFreeMse) -> f64| {
        let errors: Vec<NoiseFreeMse> = all.iter().map(|rendered| rendered.error(&single_pixels(SIDE))).collect();
        let estimates: Vec<f64> = errors.iter().map(|error| error.mse).collect();
        reported_over_true(&errors.iter().map(reported).collect::<Vec<_>>(), &estimates)
    };
    let found = ratio(&NoiseFreeMse::standard_error);
    assert!((0.8..1.25).contains(&found), "{found}");
    let twin = ratio(&|error| (error.variances().total() - error.variances().shared).sqrt());
    assert!(twin < 0.7, "{twin}");
}

fn difference(a: &Picture<LinearRgb>, b: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    Picture::from_fn(SIDE, SIDE, |x, y| LinearRgb([0, 1, 2].map(|c| a.get(x, y).0[c] - b.get(x, y).0[c])))
}

/// An estimate with this standard error, all from the reference.
fn error_of(mse: f64, noise: f64) -> NoiseFreeMse {
    NoiseFreeMse {
        mse,
        pixels: 1,
        blocks: vec![(0, BlockNoise { reference: noise, ..Default::default() })],
        common: 0.0,
    }
}

#[test]
fn psnr_of_an_estimate() {
    let psnr = |mse, noise| error_of(mse, noise).psnr().unwrap();
    let plain = |db| NoiseFreePsnr { db, exact: false, lower_bound: false };
    assert_eq!(psnr(0.01, 0.0), plain(Psnr::from_mse(0.01).unwrap().db));
    assert_eq!(psnr(0.01, 0.006), plain(Psnr::from_mse(0.01).unwrap().db));
    assert_eq!(psnr(0.0, 0.0), NoiseFreePsnr { db: 100.0, exact: true, lower_bound: false });
    assert_eq!(psnr(1e-20, 0.0), plain(100.0));
    for mse in [0.01, 0.0, -0.01, -0.02] {
        let found = psnr(mse, 0.01);
        assert!(found.lower_bound && !found.exact);
        assert!((found.db + 10.0 * libm::log10(0.01645)).abs() < 1e-9, "{mse}: {}", found.db);
    }
    assert_eq!(psnr(-1e-20, 1e-20), NoiseFreePsnr { db: 100.0, exact: false, lower_bound: true });
    assert!(matches!(error_of(f64::NAN, 0.0).psnr(), Err(MetricError::InvalidMse { .. })));
}

/// Where products of both halves' noise exceed what they are subtracted from, the error is not 0: an MSE below 0 has no
/// PSNR of 100 dB.
#[test]
fn large_products_leave_an_error() {
    let noise = BlockNoise { first_half: 1e-4, second_half: 1e-4, both_halves: 5e-4, ..Default::default() };
    let error = NoiseFreeMse { mse: -1e-4, pixels: 1, blocks: vec![(0, noise)], common: 0.0 };
    assert!((error.standard_error() - 1e-4).abs() < 1e-12);
    let psnr = error.psnr().unwrap();
    assert!(psnr.lower_bound && psnr.db < 40.0, "{psnr:?}");
}

/// No PSNR rises with its MSE, nor with its standard error; the twin, which takes an upper bound below 1.645 standard
/// errors, does.
#[test]
fn a_smaller_error_never_has_the_smaller_psnr() {
    let grid: Vec<f64> = (-400..=400).map(|k| f64::from(k) * 2.5e-5).collect();
    let noises: Vec<f64> = (0..=40).map(|k| f64::from(k) * 1e-4).collect();
    let rises = |psnr: &dyn Fn(f64, f64) -> f64| {
        let over_mse = noises.iter().any(|&noise| grid.windows(2).any(|two| psnr(two[0], noise) < psnr(two[1], noise)));
        let over_noise = grid.iter().any(|&mse| noises.windows(2).any(|two| psnr(mse, two[0]) < psnr(mse, two[1])));
        over_mse || over_noise
    };
    assert!(!rises(&|mse, noise| error_of(mse, noise).psnr().unwrap().db));
    assert!(rises(&|mse, noise| {
        let reach = ONE_SIDED_95 * noise;
        let bound = if mse > reach { mse } else { mse.max(0.0) + reach };
        Psnr::from_mse(bound).unwrap().db
    }));
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
    let error = psnr_mean_error(&[&view]).unwrap();
    assert_eq!((error.paths, error.shared), (0.0, 0.0));
    assert_eq!(total(&[]), None);
    // Under the bound, its slope is that of 1.645 standard errors; an exact view has no error that could be stated.
    assert!((total(&[&error_of(0.0, 0.002)]).unwrap() - one * 0.01 / (1.645 * 0.002)).abs() < 1e-8);
    assert_eq!(total(&[&view, &error_of(0.0, 0.0)]), None);
}
