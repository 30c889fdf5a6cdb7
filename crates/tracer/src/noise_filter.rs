//! Takes the noise out of a render without blurring its textures.
//!
//! Light that follows the base colour of surfaces is divided by it first: the quotient is smooth over surfaces. It is
//! filtered with the edge-avoiding a-trous wavelets of Dammertz et al., "Edge-Avoiding A-Trous Wavelet Transform for
//! fast Global Illumination Filtering" (2010), whose weights follow the noise as in Schied et al., "Spatiotemporal
//! Variance-Guided Filtering" (2017): pixels are averaged where they belong to one instance, face the same way, and
//! differ by no more than noise explains. As samples grow, the noise and with it the filter's effect vanish.

use mateval_image::{LUMINANCE, LinearRgb, Mask, Normal, Picture};
use rayon::prelude::*;

/// The filter's name, as files state it.
pub const NAME: &str = "a-trous";

/// The number of passes; the distance of the neighbours doubles with each.
pub const PASSES: u32 = 5;

/// The difference between pixels at which they count a quarter, in standard deviations of the noise.
pub const DEVIATIONS: f32 = 4.0;

/// The least cosine between the normals of pixels that are averaged.
pub const LEAST_COSINE: f32 = 0.9;

/// The weights of a pixel along a row or column, by its distance in steps: of a pass those up to 1, of the mean of
/// variances all.
pub const KERNEL: [f32; 4] = [0.5, 0.25, 0.125, 0.0625];

/// The least base colour that light is divided by.
const LEAST_BASE_COLOR: f32 = 0.05;

/// What a view shows, without noise. All pictures have one size.
#[derive(Clone, Copy)]
pub struct Surfaces<'a> {
    /// Linear. Light is divided by it; absent if what is filtered does not follow the base colour.
    pub base_color: Option<&'a Picture<LinearRgb>>,
    /// Instance index of each pixel.
    pub instances: &'a Picture<u16>,
    /// In world space.
    pub normals: &'a Picture<Normal>,
    /// The pixels that are filtered.
    pub valid: &'a Mask,
}

/// A pixel of divided light: its value by channel, and the variance of its luminance.
#[derive(Clone, Copy, Default)]
struct Light {
    value: [f32; 3],
    variance: f32,
}

/// The mean of two independent pictures, linear, with its noise filtered. Values may be negative. Pixels that are not
/// valid are those of the mean. The pictures are as large as those of `surfaces`.
pub fn filtered_mean(pair: [&Picture<LinearRgb>; 2], surfaces: &Surfaces<'_>) -> Picture<LinearRgb> {
    let (width, height) = (surfaces.valid.width(), surfaces.valid.height());
    let divisor = |k: usize| match surfaces.base_color {
        Some(base_color) => base_color.pixels()[k].0.map(|v| v.clamp(LEAST_BASE_COLOR, 1.0)),
        None => [1.0; 3],
    };
    let divided = |k: usize| {
        let divisor = divisor(k);
        let [a, b] = pair.map(|picture| picture.pixels()[k].0);
        let value = [0, 1, 2].map(|c| 0.5 * (a[c] + b[c]) / divisor[c]);
        let noise = luminance([0, 1, 2].map(|c| 0.5 * (a[c] - b[c]) / divisor[c]));
        Light { value, variance: noise * noise }
    };
    let mut pixels: Vec<Light> = (0..width * height).into_par_iter().map(divided).collect();
    // One pixel's difference says little of its noise: take the mean over its neighbours. What stands out of all of
    // them in one half alone is noise too.
    pixels = filter(surfaces, |at| {
        let mut found = pixels[at[1] * width + at[0]];
        found.variance = found.variance.max(mean_variance(surfaces, &pixels, at));
        found
    });
    for pass in 0..PASSES {
        pixels = filter(surfaces, |at| smoothed(surfaces, &pixels, at, 1 << pass));
    }
    Picture::from_fn(width, height, |x, y| {
        let k = y * width + x;
        if surfaces.valid.pixels()[k] {
            let divisor = divisor(k);
            return LinearRgb([0, 1, 2].map(|c| divisor[c] * pixels[k].value[c]));
        }
        let [a, b] = pair.map(|picture| picture.pixels()[k].0);
        LinearRgb([0, 1, 2].map(|c| 0.5 * (a[c] + b[c])))
    })
}

/// Computes the valid pixels.
fn filter(surfaces: &Surfaces<'_>, pixel: impl Fn([usize; 2]) -> Light + Sync) -> Vec<Light> {
    let (width, height) = (surfaces.valid.width(), surfaces.valid.height());
    let rows = (0..height).into_par_iter().flat_map_iter(|y| {
        let pixel = &pixel;
        (0..width).map(move |x| if surfaces.valid.get(x, y) { pixel([x, y]) } else { Light::default() })
    });
    rows.collect()
}

/// Visits the pixels of one surface around (x, y), at `step` pixels from each other, with the weight of their place.
fn visit_around(
    surfaces: &Surfaces<'_>,
    [x, y]: [usize; 2],
    step: usize,
    reach: usize,
    mut visit: impl FnMut(usize, f32),
) {
    let (width, height) = (surfaces.valid.width(), surfaces.valid.height());
    let (valid, instances, normals) = (surfaces.valid.pixels(), surfaces.instances.pixels(), surfaces.normals.pixels());
    let here = y * width + x;
    // The places along a row or column that stay in the picture, with their distance in steps.
    let along = |at: usize, size: usize| {
        let [before, after] = [at / step, (size - 1 - at) / step].map(|steps| steps.min(reach));
        (0..=before + after).map(move |k| (at + k * step - before * step, k.abs_diff(before)))
    };
    for (row, rows) in along(y, height) {
        for (column, columns) in along(x, width) {
            let there = row * width + column;
            if !valid[there] || instances[there] != instances[here] {
                continue;
            }
            let cosine: f32 = (0..3).map(|c| normals[here].0[c] * normals[there].0[c]).sum();
            if there == here || cosine >= LEAST_COSINE {
                visit(there, KERNEL[columns] * KERNEL[rows]);
            }
        }
    }
}

fn mean_variance(surfaces: &Surfaces<'_>, pixels: &[Light], at: [usize; 2]) -> f32 {
    let (mut sum, mut weights) = (0.0, 0.0);
    visit_around(surfaces, at, 1, 3, |there, weight| {
        sum += weight * pixels[there].variance;
        weights += weight;
    });
    sum / weights
}

/// One pass of the filter.
fn smoothed(surfaces: &Surfaces<'_>, pixels: &[Light], at: [usize; 2], step: usize) -> Light {
    let here = pixels[at[1] * surfaces.valid.width() + at[0]];
    let (own, allowed) = (luminance(here.value), DEVIATIONS * DEVIATIONS * here.variance);
    let (mut sum, mut variance, mut weights) = ([0.0; 3], 0.0, 0.0);
    visit_around(surfaces, at, step, 1, |there, place| {
        let there = pixels[there];
        let difference = (luminance(there.value) - own).powi(2);
        // Without noise, only equal pixels are averaged.
        let alike = if difference > 0.0 { allowed / (allowed + difference) } else { 1.0 };
        let weight = place * alike * alike;
        (0..3).for_each(|c| sum[c] += weight * there.value[c]);
        variance += weight * weight * there.variance;
        weights += weight;
    });
    Light { value: sum.map(|v| v / weights), variance: variance / (weights * weights) }
}

fn luminance(rgb: [f32; 3]) -> f32 {
    LUMINANCE.iter().zip(rgb).map(|(weight, value)| *weight as f32 * value).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 32;

    struct Planted {
        base_color: Picture<LinearRgb>,
        instances: Picture<u16>,
        normals: Picture<Normal>,
        valid: Mask,
    }

    /// A striped floor in two instances, under even light.
    fn planted() -> Planted {
        let stripes = Picture::from_fn(SIDE, SIDE, |x, _| LinearRgb([[0.2, 0.6][x % 2]; 3]));
        Planted {
            base_color: stripes,
            instances: Picture::from_fn(SIDE, SIDE, |x, _| 1 + u16::from(x >= SIDE / 2)),
            normals: Picture::filled(SIDE, SIDE, Normal([0.0, 1.0, 0.0])),
            valid: Mask::filled(SIDE, SIDE, true),
        }
    }

    impl Planted {
        fn surfaces(&self) -> Surfaces<'_> {
            let Self { base_color, instances, normals, valid } = self;
            Surfaces { base_color: Some(base_color), instances, normals, valid }
        }

        /// The floor under light that is brighter on the right instance, with noise of this size, in two halves.
        fn halves(&self, noise: f32) -> [Picture<LinearRgb>; 2] {
            [1, 2].map(|seed| {
                Picture::from_fn(SIDE, SIDE, |x, y| {
                    let number = mateval_dataset::splitmix64::number(seed, (y * SIDE + x) as u64);
                    let unit = (number >> 40) as f32 / (1 << 23) as f32 - 1.0;
                    let light = if x < SIDE / 2 { 1.0 } else { 1.3 };
                    LinearRgb(self.base_color.get(x, y).0.map(|v| v * (light + noise * unit)))
                })
            })
        }
    }

    fn error(a: &Picture<LinearRgb>, b: &Picture<LinearRgb>) -> f64 {
        let squares = a.pixels().iter().zip(b.pixels()).map(|(a, b)| f64::from(a.0[1] - b.0[1]).powi(2));
        (squares.sum::<f64>() / a.pixels().len() as f64).sqrt()
    }

    /// Noise falls by more than five times; stripes and the step between the instances stay.
    #[test]
    fn noise_goes_and_edges_stay() {
        let planted = planted();
        let [exact, _] = planted.halves(0.0);
        let [a, b] = planted.halves(0.5);
        let mean = Picture::from_fn(SIDE, SIDE, |x, y| {
            LinearRgb([0, 1, 2].map(|c| 0.5 * (a.get(x, y).0[c] + b.get(x, y).0[c])))
        });
        let filtered = filtered_mean([&a, &b], &planted.surfaces());
        assert!(
            error(&filtered, &exact) < 0.2 * error(&mean, &exact),
            "{} {}",
            error(&filtered, &exact),
            error(&mean, &exact)
        );
    }

    /// Without noise the filter changes nothing, whatever the picture holds.
    #[test]
    fn what_has_no_noise_stays() {
        let planted = planted();
        let sharp = Picture::from_fn(SIDE, SIDE, |x, y| LinearRgb([(x * y % 7) as f32 / 7.0, 0.5, 0.1]));
        let filtered = filtered_mean([&sharp, &sharp], &planted.surfaces());
        assert!(error(&filtered, &sharp) < 1e-6);
    }

    /// Pixels that are not valid neither change nor spread.
    #[test]
    fn pixels_that_are_not_valid_stay() {
        let mut planted = planted();
        planted.valid.set(5, 5, false);
        let [mut a, b] = planted.halves(0.5);
        let before = filtered_mean([&a, &b], &planted.surfaces());
        a.set(5, 5, LinearRgb([1e6; 3]));
        let after = filtered_mean([&a, &b], &planted.surfaces());
        assert!(after.get(5, 5).0[0] > 1e5);
        assert!((0..SIDE * SIDE).filter(|&k| k != 5 * SIDE + 5).all(|k| before.pixels()[k] == after.pixels()[k]));
    }
}
