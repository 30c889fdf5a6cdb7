//! Tests whether two renderers' pictures of one scene agree, at the scale of pixels, of 8x8 tiles and of the whole
//! picture.
//!
//! Each side has K independent renders. Their spread gives the variance of each pixel's mean, so no noise model is
//! needed. In both renderers each pixel has its own random numbers, so the variances of tiles and of the whole picture
//! are sums of those of pixels. For each channel there are five tests, each with a p-value:
//!
//! - whole: the difference of the means, normal;
//! - tiles: the sum of the squared z, chi-square with one degree of freedom for each tile; and the worst z, normal, with
//!   Bonferroni's factor;
//! - pixels: the mean of squared differences divided by the tile's mean variance, which is 1 for any distribution of a
//!   pixel (the tile's variance is estimated from 64 times 2 (K - 1) values), against its own standard error; and the
//!   worst Student's t with K - 1 degrees of freedom (fewer than Welch's, which favours agreement), computed with the
//!   larger of the pixel's and its tile's variance, with Bonferroni's factor.
//!
//! One scene makes 15 tests. A test fails if its p-value is below [`FALSE_ALARM`], so a scene that agrees fails with a
//! probability of at most 1.5e-4 as far as those distributions hold: heavy tails within a render are averaged over its
//! samples.

use std::f64::consts::{FRAC_PI_2, SQRT_2};

use mateval_image::{LinearRgb, Picture};

use mateval_testkit::statistics::{Estimate, chi_square_z};

/// A test with a p-value below this fails.
pub const FALSE_ALARM: f64 = 1e-5;

const TILE: usize = 8;

/// Independent renders of one view.
pub type Renders = Vec<Picture<LinearRgb>>;

/// The comparison of one channel, or of the worst of all three.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// The first side's mean divided by the second's.
    pub ratio: f64,
    /// Standard error of the ratio.
    pub error: f64,
    /// The whole picture's z.
    pub whole_z: f64,
    /// The mean squared z of tiles, 1 where they agree.
    pub tile_mean: f64,
    pub worst_tile: f64,
    /// The mean squared z of pixels, 1 where they agree.
    pub pixel_mean: f64,
    pub worst_pixel: f64,
    /// The smallest p-value of the five tests, and which.
    pub p: f64,
    pub test: &'static str,
}

impl Agreement {
    pub fn holds(&self) -> bool {
        self.p >= FALSE_ALARM
    }
}

/// The comparison of the channel with the smallest p-value.
pub fn compare(ours: &Renders, theirs: &Renders) -> Agreement {
    let channels = (0..3).map(|channel| compare_channel(&Side::new(ours, channel), &Side::new(theirs, channel)));
    channels.min_by(|a, b| a.p.total_cmp(&b.p)).unwrap()
}

/// One channel of one side: mean and variance of the mean for each pixel.
struct Side {
    width: usize,
    height: usize,
    renders: usize,
    mean: Vec<f64>,
    variance: Vec<f64>,
}

impl Side {
    fn new(renders: &Renders, channel: usize) -> Self {
        let (width, height) = (renders[0].width(), renders[0].height());
        let k = renders.len() as f64;
        let (mut mean, mut variance) = (Vec::new(), Vec::new());
        for pixel in 0..width * height {
            let values = || renders.iter().map(|picture| f64::from(picture.pixels()[pixel].0[channel]));
            let average = values().sum::<f64>() / k;
            mean.push(average);
            variance.push(values().map(|v| (v - average) * (v - average)).sum::<f64>() / (k - 1.0) / k);
        }
        Self { width, height, renders: renders.len(), mean, variance }
    }
}

fn compare_channel(ours: &Side, theirs: &Side) -> Agreement {
    assert_eq!((ours.width, ours.height, ours.renders), (theirs.width, theirs.height, theirs.renders));
    let difference: Vec<f64> = ours.mean.iter().zip(&theirs.mean).map(|(a, b)| a - b).collect();
    // Without randomness, an error of rounding to f32 remains: a millionth of the value.
    let rounding = |k: usize| (1e-6 * theirs.mean[k]).powi(2).max(1e-24);
    let variance: Vec<f64> =
        (0..difference.len()).map(|k| ours.variance[k] + theirs.variance[k] + rounding(k)).collect();
    let tiles = tiles(ours.width, ours.height);
    let sum = |values: &[f64], pixels: &[usize]| pixels.iter().map(|&k| values[k]).sum::<f64>();
    let z_of = |pixels: &[usize]| sum(&difference, pixels) / sum(&variance, pixels).sqrt();

    let whole_z = z_of(&(0..difference.len()).collect::<Vec<_>>());
    let tile_z: Vec<f64> = tiles.iter().map(|tile| z_of(tile)).collect();
    let (mut squares, mut worst_pixel) = (Vec::new(), 0.0_f64);
    for tile in &tiles {
        let common = sum(&variance, tile) / tile.len() as f64;
        for &k in tile {
            squares.push(difference[k] * difference[k] / common);
            worst_pixel = worst_pixel.max(difference[k].abs() / variance[k].max(common).sqrt());
        }
    }
    let pixel = Estimate::of(&squares);
    let tile_mean = tile_z.iter().map(|z| z * z).sum::<f64>() / tile_z.len() as f64;
    let worst_tile = tile_z.iter().fold(0.0_f64, |worst, z| worst.max(z.abs()));
    let tests = [
        ("whole", two_sided(whole_z)),
        ("tiles", upper(chi_square_z(tile_mean, tile_z.len() as f64))),
        ("worst tile", tile_z.len() as f64 * two_sided(worst_tile)),
        ("pixels", upper(pixel.z(1.0))),
        ("worst pixel", squares.len() as f64 * student(worst_pixel, (ours.renders - 1) as f64)),
    ];
    let (test, p) = tests.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    let [a, b] = [ours, theirs].map(|side| side.mean.iter().sum::<f64>());
    let error = variance.iter().sum::<f64>().sqrt() / b;
    Agreement { ratio: a / b, error, whole_z, tile_mean, worst_tile, pixel_mean: pixel.mean, worst_pixel, p, test }
}

/// The pixels of each tile; those at the right and lower edge may be smaller.
fn tiles(width: usize, height: usize) -> Vec<Vec<usize>> {
    let tile = |x0: usize, y0: usize| {
        let rows = y0..(y0 + TILE).min(height);
        rows.flat_map(|y| (x0..(x0 + TILE).min(width)).map(move |x| y * width + x)).collect()
    };
    (0..height).step_by(TILE).flat_map(|y| (0..width).step_by(TILE).map(move |x| tile(x, y))).collect()
}

/// The probability that a standard normal lies further from 0.
fn two_sided(z: f64) -> f64 {
    libm::erfc(z.abs() / SQRT_2)
}

/// The probability that a standard normal is larger.
fn upper(z: f64) -> f64 {
    0.5 * libm::erfc(z / SQRT_2)
}

/// The probability that Student's t lies further from 0: with t = sqrt(n) tan(a), its density is cos(a)^(n - 1) da.
fn student(t: f64, freedom: f64) -> f64 {
    let integral = |from: f64| {
        const STEPS: u32 = 2000;
        let width = (FRAC_PI_2 - from) / f64::from(STEPS);
        let density = |step: u32| libm::cos(from + (f64::from(step) + 0.5) * width).max(0.0).powf(freedom - 1.0);
        (0..STEPS).map(density).sum::<f64>() * width
    };
    integral(libm::atan(t.abs() / freedom.sqrt())) / integral(0.0)
}

mod tests {
    use super::*;

    /// Renders of 64x48 pixels of a gradient, with nearly normal noise from sums of 12 hashed numbers.
    fn renders(seed: u32, level: impl Fn(usize, usize) -> f32) -> Renders {
        let hash = |a: u32| {
            let mut h = a.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
            for _ in 0..3 {
                h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
                h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
            }
            (h >> 8) as f32 / (1 << 24) as f32
        };
        let picture = |render: u32| {
            Picture::from_fn(64, 48, |x, y| {
                let at = ((seed * 16 + render) * 48 + y as u32) * 64 + x as u32;
                let channel = |c: u32| (0..12).map(|k| hash((at * 3 + c) * 12 + k)).sum::<f32>() - 6.0;
                LinearRgb([0, 1, 2].map(|c| level(x, y) * (1.0 + 0.1 * channel(c))))
            })
        };
        (0..16).map(picture).collect()
    }

    fn gradient(x: usize, y: usize) -> f32 {
        0.1 + x as f32 / 64.0 + (y % 7) as f32
    }

    #[test]
    fn equal_expectations_agree() {
        for seed in 0..10 {
            let found = compare(&renders(2 * seed, gradient), &renders(2 * seed + 1, gradient));
            assert!(found.holds(), "{found:?}");
            assert!((found.pixel_mean - 1.0).abs() < 0.2 && (found.tile_mean - 1.0).abs() < 0.8, "{found:?}");
        }
    }

    /// The twins: everything 0.5 % brighter; one tile 4 % brighter; one pixel twice as bright; signs that alternate
    /// over pixels.
    #[test]
    fn each_scale_finds_its_fault() {
        let truth = renders(90, gradient);
        let found_by = |factor: &dyn Fn(usize, usize) -> f32| {
            let found = compare(&renders(91, |x, y| gradient(x, y) * factor(x, y)), &truth);
            assert!(!found.holds(), "the twin passes: {found:?}");
            found.test
        };
        assert_eq!(found_by(&|_, _| 1.005), "whole");
        assert_eq!(found_by(&|x, y| if x / 8 == 2 && y / 8 == 3 { 1.04 } else { 1.0 }), "worst tile");
        assert_eq!(found_by(&|x, y| if (x, y) == (9, 9) { 2.0 } else { 1.0 }), "worst pixel");
        assert_eq!(found_by(&|x, y| if (x + y) % 2 == 0 { 1.02 } else { 0.98 }), "pixels");
        assert_eq!(found_by(&|x, y| if (x / 8 + y / 8) % 2 == 0 { 1.008 } else { 0.992 }), "tiles");
    }

    /// Tables: t of 15 degrees of freedom beyond 2.131 has 5 %, beyond 4.073 0.1 %; a normal beyond 1.96 has 5 %.
    #[test]
    fn known_quantiles() {
        assert!((student(2.131, 15.0) - 0.05).abs() < 1e-4, "{}", student(2.131, 15.0));
        assert!((student(4.073, 15.0) - 0.001).abs() < 1e-5);
        assert!((two_sided(1.959_964) - 0.05).abs() < 1e-6 && (upper(1.644_854) - 0.05).abs() < 1e-6);
        // The 5 % point of chi-square with 10 degrees of freedom is 18.307.
        assert!((upper(chi_square_z(1.8307, 10.0)) - 0.05).abs() < 1e-3);
    }
}
