//! Fits of three lights to photos that are sums of them.

use mateval_image::Mask;

use super::*;

/// Three lights on 30 x 20 pixels: from the left, from the top, from everywhere.
fn basis() -> LightBasis {
    let picture = |light: fn(f32, f32) -> f32| {
        Picture::from_fn(30, 20, |x, y| {
            let value = light(x as f32 / 30.0, y as f32 / 20.0);
            LinearRgb([value, 0.5 * value, 0.25 * value * value])
        })
    };
    let pictures = vec![picture(|x, _| (1.0 - x) * (1.0 - x)), picture(|_, y| 1.0 - y), picture(|_, _| 0.5)];
    LightBasis::new(30, 20, pictures).unwrap()
}

/// A ridge too small to move exact data.
fn rules() -> FitRules {
    FitRules { ridge: 1e-7, ..Default::default() }
}

/// A photo that nothing clips.
fn faint<'a>(photo: &'a Picture<LinearRgb>, mask: Option<&'a Mask>) -> FitTarget<'a> {
    FitTarget { photo, mask, exposure: 1e-3 }
}

const WEIGHTS: [[f64; 3]; 3] = [[0.5, 2.0, 0.0], [1.0, 0.0, 3.0], [0.0, 0.25, 1.0]];

fn error(fit: &LightFit) -> f64 {
    let pairs = fit.weights.iter().flatten().zip(WEIGHTS.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn weights_of_each_channel_are_found() {
    let photo = basis().weighted(&WEIGHTS).unwrap();
    let fit = fit_lights(&rules(), &basis(), &faint(&photo, None)).unwrap();
    assert!(error(&fit) < 1e-5, "{:?}", fit.weights);
    assert!(fit.relative_gap < 1e-6, "{}", fit.relative_gap);
}

/// A window that no light of the basis explains does not count when it is masked out, and does when it fills half.
#[test]
fn pixels_outside_the_mask_do_not_count() {
    let mut photo = basis().weighted(&WEIGHTS).unwrap();
    let mask = Mask::from_fn(30, 20, |x, _| x < 13);
    for y in 0..20 {
        (13..30).for_each(|x| photo.set(x, y, LinearRgb([9.0; 3])));
    }
    assert!(error(&fit_lights(&rules(), &basis(), &faint(&photo, Some(&mask))).unwrap()) < 1e-5);
    assert!(error(&fit_lights(&rules(), &basis(), &faint(&photo, None)).unwrap()) > 0.1, "the twin passes");
}

/// Highlights far above what clips do not move the weights, whatever their height, and neither does clipping them in the
/// photo. With an exposure at which nothing clips they do.
#[test]
fn the_height_of_clipped_highlights_does_not_count() {
    let plain = basis().weighted(&WEIGHTS).unwrap();
    let with = |value: f32| {
        Picture::from_fn(30, 20, |x, y| if (x / 4 + y / 4) % 2 == 0 { LinearRgb([value; 3]) } else { plain.get(x, y) })
    };
    let fit = |photo: &Picture<LinearRgb>, exposure: f64| {
        fit_lights(&FitRules::default(), &basis(), &FitTarget { photo, mask: None, exposure }).unwrap()
    };
    // The brightest pixel of the plain photo is below 2.1.
    let [low, high] = [3.0, 30.0].map(|value| fit(&with(value), 0.4));
    assert_eq!(low, high);
    let twin = [3.0, 30.0].map(|value| fit(&with(value), 1e-3));
    assert!(twin[0].weights != twin[1].weights, "the twin passes");
}

#[test]
fn the_start_meets_the_means() {
    let photo = basis().weighted(&WEIGHTS).unwrap();
    let rules = FitRules { ridge: 1e6, ..rules() };
    let fit = fit_lights(&rules, &basis(), &faint(&photo, None)).unwrap();
    for channel in 0..3 {
        assert!(fit.weights.iter().all(|weight| (weight[channel] / fit.start[channel] - 1.0).abs() < 1e-5));
        let mean = |picture: &Picture<LinearRgb>| {
            picture.pixels().iter().map(|pixel| f64::from(pixel.0[channel])).sum::<f64>() / 600.0
        };
        assert!((mean(&basis().sum()) * fit.start[channel] / mean(&photo) - 1.0).abs() < 1e-5);
    }
}

/// With weaker lights of any unit the fit is the same, since weights are compared with their start.
#[test]
fn units_do_not_matter() {
    let photo = basis().weighted(&WEIGHTS).unwrap().map(|pixel| LinearRgb(pixel.0.map(|v| v + 0.3)));
    let rules = FitRules::default();
    let fit = fit_lights(&rules, &basis(), &faint(&photo, None)).unwrap();
    let scaled = |picture: &Picture<LinearRgb>| picture.map(|pixel| LinearRgb(pixel.0.map(|v| v / 1024.0)));
    let dim = LightBasis::new(30, 20, basis().pictures().iter().map(scaled).collect()).unwrap();
    let dim = fit_lights(&rules, &dim, &faint(&photo, None)).unwrap();
    let pairs = fit.weights.iter().flatten().zip(dim.weights.iter().flatten());
    assert!(pairs.into_iter().all(|(a, b)| (b / 1024.0 - a).abs() < 1e-6), "{:?} {:?}", fit.weights, dim.weights);
}

#[test]
fn squares_are_averaged_and_edges_count_by_area() {
    let picture = Picture::from_fn(12, 8, |x, y| LinearRgb([(x + y) as f32, 1.0, 0.0]));
    let [red, green, blue] = pooled(&rules(), &picture, None);
    assert_eq!((red[0], &green[..], &blue[..]), (7.0, &[1.0, 0.5][..], &[0.0, 0.0][..]));
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let message = |basis: &LightBasis, photo: &Picture<LinearRgb>, mask: Option<&Mask>| {
        fit_lights(&rules(), basis, &faint(photo, mask)).unwrap_err().to_string()
    };
    let photo = basis().sum();
    let small = Picture::filled(4, 4, LinearRgb([1.0; 3]));
    assert!(message(&basis(), &small, None).contains("the basis has 30x20 pixels, the photo 4x4"));
    assert!(message(&basis(), &photo, Some(&Mask::filled(4, 4, true))).contains("the mask"));
    let mut broken = photo.clone();
    broken.set(3, 3, LinearRgb([f32::NAN; 3]));
    assert!(message(&basis(), &broken, None).contains("pixel (3, 3) of the photo is [NaN"));
    let mut infinite = basis().pictures().to_vec();
    infinite[1].set(0, 0, LinearRgb([f32::INFINITY; 3]));
    let infinite = LightBasis::new(30, 20, infinite).unwrap();
    assert!(message(&infinite, &photo, None).contains("light group 1"));
    // Rules and exposure.
    let rules = FitRules { ridge: 0.0, ..rules() };
    let error = fit_lights(&rules, &basis(), &faint(&photo, None)).unwrap_err().to_string();
    assert!(error.contains("the ridge is 0"), "{error}");
    let target = FitTarget { exposure: f64::NAN, ..faint(&photo, None) };
    let error = fit_lights(&FitRules::default(), &basis(), &target).unwrap_err().to_string();
    assert!(error.contains("the exposure is NaN"), "{error}");
    // Streams of different lights.
    let fewer = LightBasis::new(30, 20, basis().pictures()[..2].to_vec()).unwrap();
    let error = fit_two_streams(&FitRules::default(), [&basis(), &fewer], &faint(&photo, None)).unwrap_err();
    assert!(error.to_string().contains("3 and 2 light groups"), "{error}");
}

/// Black photos and no lights at all are fitted, by nothing.
#[test]
fn nothing_is_fitted_by_nothing() {
    let black = fit_lights(&rules(), &basis(), &faint(&Picture::filled(30, 20, LinearRgb::default()), None)).unwrap();
    assert_eq!((black.weights, black.relative_gap), (vec![[0.0; 3]; 3], 0.0));
    let none = LightBasis::new(30, 20, Vec::new()).unwrap();
    let fit = fit_lights(&rules(), &none, &faint(&basis().sum(), None)).unwrap();
    assert!(fit.weights.is_empty() && fit.relative_gap == 0.0, "{fit:?}");
}

/// The basis with noise of relative size `noise` in every pixel.
fn noisy(seed: u64, noise: f32) -> LightBasis {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut shaken = |pixel: LinearRgb| LinearRgb(pixel.0.map(|v| v * (1.0 + noise * (2.0 * unit() - 1.0))));
    let pictures = basis().pictures().iter().map(|picture| picture.map(&mut shaken)).collect();
    LightBasis::new(30, 20, pictures).unwrap()
}

/// The spread's mean square is the variance of the mean weights over 200 pairs of bases; equal bases have none.
#[test]
fn the_spread_is_the_noise_of_the_weights() {
    let photo = basis().weighted(&WEIGHTS).unwrap().map(|pixel| LinearRgb(pixel.0.map(|v| v + 0.3)));
    let rules = FitRules { pool: 4, ..Default::default() };
    let fit = |seed: u64| {
        let bases = [noisy(2 * seed + 1, 0.9), noisy(2 * seed + 2, 0.9)];
        fit_two_streams(&rules, [&bases[0], &bases[1]], &faint(&photo, None)).unwrap()
    };
    let fits: Vec<TwoStreamFit> = (0..200).map(fit).collect();
    let numbers = |of: &dyn Fn(&TwoStreamFit) -> f64| fits.iter().map(of).collect::<Vec<f64>>();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    for (light, channel) in [(0, 0), (1, 0), (2, 0), (0, 1), (2, 1)] {
        let weights = numbers(&|fit| fit.weights()[light][channel]);
        let centre = mean(&weights);
        let variance = mean(&weights.iter().map(|w| (w - centre) * (w - centre)).collect::<Vec<f64>>());
        let estimate = mean(&numbers(&|fit| fit.spread()[light][channel].powi(2)));
        assert!((0.6..1.6).contains(&(estimate / variance)), "{light} {channel}: {estimate} {variance}");
    }
    let same = noisy(1, 0.9);
    let fit = fit_two_streams(&rules, [&same, &same], &faint(&photo, None)).unwrap();
    assert!(fit.spread().iter().flatten().all(|spread| *spread == 0.0));
    assert_eq!(fit.weights(), fit.streams[0].weights);
}
