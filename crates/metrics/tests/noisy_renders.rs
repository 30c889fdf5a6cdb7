//! LPIPS extrapolated to no noise, with the real network: 64 samples against 4096.
//!
//! The weights lie in MatEval's cache folder. Where they are missing, tests are skipped, or fail
//! (`mateval_testkit::data`).
#![allow(clippy::unwrap_used)] // tests may

mod weights;

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::{ExtrapolatedLpips, Lpips, MeanAndHalves, Net};
use mateval_testkit::synthetic_noise::{Render, SCATTERS, Scatter, mean_of, waves};

const SIDE: usize = 96;

/// A simple picture of a room, flatter than the waves: LPIPS reacts to noise most where the picture is flat.
fn reference() -> Picture<LinearRgb> {
    let waves = waves(SIDE);
    Picture::from_fn(SIDE, SIDE, |x, y| match (x / 24 + y / 32) % 3 {
        0 => LinearRgb([0.5, 0.35, 0.2]),
        1 => LinearRgb([0.1 + 0.5 * x as f32 / SIDE as f32; 3]),
        _ => waves.get(x, y),
    })
}

fn prediction() -> Picture<LinearRgb> {
    let reference = reference();
    Picture::from_fn(SIDE, SIDE, |x, y| {
        let factor = if (x / 6 + y / 6) % 2 == 0 { 0.85 } else { 0.95 };
        LinearRgb(reference.get(x, y).0.map(|value| value * factor))
    })
}

/// The mean of both halves and the halves, encoded; `samples` together. The standard deviation of one sample is half
/// its value.
fn noisy(scatter: Scatter, samples: u32) -> [Picture<SrgbRgb>; 3] {
    let strength = match scatter {
        Scatter::GaussianLike => 0.5,
        Scatter::HeavyTailed => 0.5 / 3.0,
    };
    let render = Render { scatter, strength, samples: samples / 2, blocks: None, view: 0 };
    let [a, b] = [1, 2].map(|seed| render.picture(&prediction(), seed + u64::from(samples)));
    [mean_of(&a, &b), a, b].map(|picture| picture.to_srgb())
}

/// Under both mask rules.
fn measure(lpips: &Lpips, [mean, a, b]: &[Picture<SrgbRgb>; 3]) -> [ExtrapolatedLpips; 2] {
    let (reference, prediction) = (reference().to_srgb(), MeanAndHalves { mean, a, b });
    let mask: Mask = Picture::from_fn(SIDE, SIDE, |x, y| x > 20 || y > 30);
    let (whole, black) = (lpips.features(&reference).unwrap(), lpips.black_filled_features(&reference, &mask).unwrap());
    [
        lpips.extrapolated_masked(prediction, &whole, &mask).unwrap().unwrap(),
        lpips.extrapolated_black_fill(prediction, &black, &mask).unwrap().unwrap(),
    ]
}

#[test]
fn sixty_four_samples_are_as_good_as_4096() {
    let Some(lpips) = weights::load_lpips(Net::Alex) else { return };
    for scatter in SCATTERS {
        let (few, many) = (measure(&lpips, &noisy(scatter, 64)), measure(&lpips, &noisy(scatter, 4096)));
        for (few, many) in few.iter().zip(&many) {
            assert!((few.lpips - many.of_mean).abs() < 0.01, "{scatter:?}: {few:?} for {many:?}");
            // The twin: without extrapolation the error is larger.
            assert!((few.of_mean - many.of_mean).abs() > 0.03, "{scatter:?}: {few:?} for {many:?}");
        }
    }
}

#[test]
fn the_thread_count_changes_no_bit() {
    let Some(lpips) = weights::load_lpips(Net::Alex) else { return };
    let noisy = noisy(Scatter::HeavyTailed, 16);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| measure(&lpips, &noisy))
    };
    assert_eq!(with(1), with(2));
}
