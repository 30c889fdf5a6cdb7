//! A noisy prediction of light as SSIM, LPIPS and people see it: with little noise, and without blurring its textures.
//!
//! Most of a predicted picture is known without noise of its own: it is close to the truth's picture T (denoised, or with
//! little noise) times the ratio r of the predicted base colour to the true one. What remains, P - r T, is light that the prediction's own colours bounce, and
//! reflections; divided by the predicted base colour it is smooth over surfaces. It alone is filtered, with the
//! edge-avoiding a-trous wavelets of Dammertz et al., "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination
//! Filtering" (2010), whose weights follow the noise as in Schied et al., "Spatiotemporal Variance-Guided Filtering" (2017):
//! pixels are averaged where they belong to one instance, face the same way, and differ by no more than noise explains. As
//! samples grow, the noise and with it the filter's effect vanish: what is shown converges to the prediction.

use mateval_image::{LUMINANCE, LinearRgb, Mask, Normal, Picture};
use rayon::prelude::*;

/// The number of passes; the distance of the neighbours doubles with each.
pub const PASSES: u32 = 5;

/// The difference between pixels at which they count a quarter, in standard deviations of the noise.
pub const DEVIATIONS: f32 = 4.0;

/// The least cosine between the normals of pixels that are averaged.
pub const LEAST_COSINE: f32 = 0.9;

/// The least base colour that light is divided by.
pub const LEAST_BASE_COLOR: f32 = 0.05;

/// What the filter knows about a view without noise.
#[derive(Clone, Copy)]
pub struct ViewGuide<'a> {
    /// The truth's picture (denoised, or the mean of its halves), exposed.
    pub truth: &'a Picture<LinearRgb>,
    /// The predicted base colour over the true one.
    pub ratio: &'a Picture<LinearRgb>,
    /// The predicted base colour.
    pub base_color: &'a Picture<LinearRgb>,
    /// Instance index of each pixel.
    pub instances: &'a Picture<u16>,
    /// In world space.
    pub normals: &'a Picture<Normal>,
    /// The pixels that count.
    pub valid: &'a Mask,
}

/// A pixel of the remainder: its value by channel, and the variance of its luminance.
#[derive(Clone, Copy, Default)]
struct Remainder {
    value: [f32; 3],
    variance: f32,
}

/// The mean of two independent halves, exposed, with the noise of its remainder filtered. Pixels that do not count are
/// those of the mean.
pub fn shown_render(halves: [&Picture<LinearRgb>; 2], guide: &ViewGuide<'_>) -> Picture<LinearRgb> {
    let (width, height) = (guide.valid.width(), guide.valid.height());
    let divisor = |k: usize| guide.base_color.pixels()[k].0.map(|v| v.clamp(LEAST_BASE_COLOR, 1.0));
    let known = |k: usize| {
        let (truth, ratio) = (guide.truth.pixels()[k].0, guide.ratio.pixels()[k].0);
        [0, 1, 2].map(|c| truth[c] * ratio[c])
    };
    let remainder = |k: usize| {
        let (divisor, known) = (divisor(k), known(k));
        let [a, b] = halves.map(|half| half.pixels()[k].0);
        let value = [0, 1, 2].map(|c| (0.5 * (a[c] + b[c]) - known[c]) / divisor[c]);
        let noise = luminance([0, 1, 2].map(|c| 0.5 * (a[c] - b[c]) / divisor[c]));
        Remainder { value, variance: noise * noise }
    };
    let mut pixels: Vec<Remainder> = (0..width * height).into_par_iter().map(remainder).collect();
    // One pixel's difference says little of its noise: take the mean over its neighbours.
    pixels = filter(guide, |x, y| {
        let mut found = pixels[y * width + x];
        found.variance = mean_variance(guide, &pixels, x, y);
        found
    });
    for pass in 0..PASSES {
        pixels = filter(guide, |x, y| smoothed(guide, &pixels, x, y, 1 << pass));
    }
    Picture::from_fn(width, height, |x, y| {
        let k = y * width + x;
        let (known, divisor) = (known(k), divisor(k));
        if guide.valid.pixels()[k] {
            return LinearRgb([0, 1, 2].map(|c| known[c] + divisor[c] * pixels[k].value[c]));
        }
        let [a, b] = halves.map(|half| half.pixels()[k].0);
        LinearRgb([0, 1, 2].map(|c| 0.5 * (a[c] + b[c])))
    })
}

/// Computes the pixels that count.
fn filter(guide: &ViewGuide<'_>, pixel: impl Fn(usize, usize) -> Remainder + Sync) -> Vec<Remainder> {
    let (width, height) = (guide.valid.width(), guide.valid.height());
    let rows = (0..height).into_par_iter().flat_map_iter(|y| {
        let pixel = &pixel;
        (0..width).map(move |x| if guide.valid.get(x, y) { pixel(x, y) } else { Remainder::default() })
    });
    rows.collect()
}

/// The pixels of one surface around (x, y), at `step` pixels from each other, with the weight of their place.
fn around<'g>(
    guide: &'g ViewGuide<'_>,
    x: usize,
    y: usize,
    step: isize,
    reach: isize,
) -> impl Iterator<Item = (usize, f32)> + use<'g> {
    let (width, height) = (guide.valid.width(), guide.valid.height());
    let here = y * width + x;
    let (instance, normal) = (guide.instances.pixels()[here], guide.normals.pixels()[here].0);
    (-reach..=reach).flat_map(move |dy| (-reach..=reach).map(move |dx| (dx, dy))).filter_map(move |(dx, dy)| {
        let column = x.checked_add_signed(step * dx).filter(|&column| column < width)?;
        let row = y.checked_add_signed(step * dy).filter(|&row| row < height)?;
        let there = row * width + column;
        let other = guide.normals.pixels()[there].0;
        let cosine: f32 = (0..3).map(|c| normal[c] * other[c]).sum();
        let is_alike = guide.valid.pixels()[there]
            && guide.instances.pixels()[there] == instance
            && (there == here || cosine >= LEAST_COSINE);
        let weight = |distance: isize| [0.5, 0.25, 0.125, 0.0625][distance.unsigned_abs()];
        is_alike.then(|| (there, weight(dx) * weight(dy)))
    })
}

fn mean_variance(guide: &ViewGuide<'_>, pixels: &[Remainder], x: usize, y: usize) -> f32 {
    let (sum, weights) = around(guide, x, y, 1, 3)
        .fold((0.0, 0.0), |(sum, weights), (k, weight)| (sum + weight * pixels[k].variance, weights + weight));
    sum / weights
}

/// One pass of the filter.
fn smoothed(guide: &ViewGuide<'_>, pixels: &[Remainder], x: usize, y: usize, step: isize) -> Remainder {
    let here = pixels[y * guide.valid.width() + x];
    let (own, allowed) = (luminance(here.value), DEVIATIONS * DEVIATIONS * here.variance);
    let (mut sum, mut variance, mut weights) = ([0.0; 3], 0.0, 0.0);
    for (k, place) in around(guide, x, y, step, 1) {
        let there = pixels[k];
        let difference = (luminance(there.value) - own).powi(2);
        // Without noise, only equal pixels are averaged.
        let alike = if difference > 0.0 { allowed / (allowed + difference) } else { 1.0 };
        let weight = place * alike * alike;
        (0..3).for_each(|c| sum[c] += weight * there.value[c]);
        variance += weight * weight * there.variance;
        weights += weight;
    }
    Remainder { value: sum.map(|v| v / weights), variance: variance / (weights * weights) }
}

fn luminance(rgb: [f32; 3]) -> f32 {
    LUMINANCE.iter().zip(rgb).map(|(weight, value)| *weight as f32 * value).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 32;

    struct Planted {
        truth: Picture<LinearRgb>,
        ratio: Picture<LinearRgb>,
        base_color: Picture<LinearRgb>,
        instances: Picture<u16>,
        normals: Picture<Normal>,
        valid: Mask,
    }

    /// A striped floor in two instances, under even light.
    fn planted() -> Planted {
        let flat = |value: f32| Picture::filled(SIDE, SIDE, LinearRgb([value; 3]));
        let stripes = Picture::from_fn(SIDE, SIDE, |x, _| LinearRgb([[0.2, 0.6][x % 2]; 3]));
        Planted {
            truth: stripes.clone(),
            ratio: flat(1.0),
            base_color: stripes,
            instances: Picture::from_fn(SIDE, SIDE, |x, _| 1 + u16::from(x >= SIDE / 2)),
            normals: Picture::filled(SIDE, SIDE, Normal([0.0, 1.0, 0.0])),
            valid: Mask::filled(SIDE, SIDE, true),
        }
    }

    impl Planted {
        fn guide(&self) -> ViewGuide<'_> {
            let Self { truth, ratio, base_color, instances, normals, valid } = self;
            ViewGuide { truth, ratio, base_color, instances, normals, valid }
        }

        /// The floor under light that is brighter on the right instance, with noise of this size, in two halves.
        fn halves(&self, noise: f32) -> [Picture<LinearRgb>; 2] {
            [1, 2].map(|seed| {
                Picture::from_fn(SIDE, SIDE, |x, y| {
                    let number = mateval_scene::splitmix64::number(seed, (y * SIDE + x) as u64);
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
        let shown = shown_render([&a, &b], &planted.guide());
        assert!(
            error(&shown, &exact) < 0.2 * error(&mean, &exact),
            "{} {}",
            error(&shown, &exact),
            error(&mean, &exact)
        );
    }

    /// Without noise the filter changes nothing, whatever the remainder holds.
    #[test]
    fn what_has_no_noise_stays() {
        let planted = planted();
        let sharp = Picture::from_fn(SIDE, SIDE, |x, y| LinearRgb([(x * y % 7) as f32 / 7.0, 0.5, 0.1]));
        let shown = shown_render([&sharp, &sharp], &planted.guide());
        assert!(error(&shown, &sharp) < 1e-6);
    }

    /// Pixels that do not count neither change nor spread.
    #[test]
    fn pixels_outside_the_mask_do_not_count() {
        let mut planted = planted();
        planted.valid.set(5, 5, false);
        let [mut a, b] = planted.halves(0.5);
        let before = shown_render([&a, &b], &planted.guide());
        a.set(5, 5, LinearRgb([1e6; 3]));
        let after = shown_render([&a, &b], &planted.guide());
        assert!(after.get(5, 5).0[0] > 1e5);
        assert!((0..SIDE * SIDE).filter(|&k| k != 5 * SIDE + 5).all(|k| before.pixels()[k] == after.pixels()[k]));
    }
}
