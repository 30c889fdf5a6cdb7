//! Which parts are mirrors.
//!
//! A mirror shows what the photo shows elsewhere. For each flat part a ray is mirrored at every pixel; where it meets a
//! place that the photo shows too, the pixel should be as bright as that place. The pictures are compared without their
//! slow changes (both may darken towards a corner), by their correlation, and by how much of the pixel's brightness
//! follows the mirrored one: gloss over a diffuse floor follows it weakly.

use std::collections::BTreeMap;

use glam::{DVec2, Vec3};
use mateval_image::{LinearRgb, Normal};
use mateval_tracer::{PhotoCache, Ray, Sampler, SurfaceHit};
use rayon::prelude::*;

use super::room::PartRoom;
use super::surfaces::upper_median;

/// A part that mirrors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mirror {
    /// Linear, at metallic 1.
    pub(super) base_color: [f32; 3],
    /// Perceptual roughness.
    pub(super) roughness: f32,
}

/// The least pixels of a part that may be a mirror, as a share of the photo's: 400 of 480x270.
const LEAST_SHARE: f64 = 0.003;
/// The least number of its pixels whose mirrored place the photo shows.
const LEAST_SHOWN: usize = 60;
/// The least cosine between a flat part's normals and their mean.
const FLAT_COSINE: f32 = 0.995;
/// The share of its pixels for which that holds.
const FLAT_SHARE: f64 = 0.8;
/// The least correlation of a mirror with what it shows.
const LEAST_CORRELATION: f64 = 0.6;
/// The least slope of a mirror's radiance over the mirrored one, both as logarithms.
const LEAST_SLOPE: f64 = 0.75;
/// The least radiance that counts, as a share of the mean of what is compared, and the largest deviation of a
/// logarithm.
const DARKEST: f64 = 1e-4;
const MOST_CONTRAST: f64 = 1.5;
/// Pixels on each side over which slow changes are averaged, as a share of the photo's width.
const SLOW_REACH: f64 = 0.035;
/// Perceptual roughness values that are tried, and the rays of each pixel.
const ROUGHNESSES: [f32; 4] = [0.02, 0.05, 0.1, 0.2];
const RAYS: u32 = 8;

/// The mirrors among the surfaces of the room.
pub(super) fn find_mirrors(room: &PartRoom, cache: &PhotoCache<'_>) -> BTreeMap<u16, Mirror> {
    let mut pixels: BTreeMap<u16, Vec<usize>> = BTreeMap::new();
    for (k, part) in room.parts.pixels().iter().enumerate().filter(|(k, _)| room.valid.pixels()[*k]) {
        pixels.entry(*part).or_default().push(k);
    }
    let least = (LEAST_SHARE * room.photo.pixels().len() as f64) as usize;
    let flat = pixels.into_iter().filter(|(_, pixels)| pixels.len() >= least);
    let flat = flat.filter_map(|(part, pixels)| Some((part, flat_pixels(room, &pixels)?)));
    flat.filter_map(|(part, pixels)| Some((part, mirror(room, cache, &pixels)?))).collect()
}

/// The pixels of a flat part, without those of its edges; none if it is not flat.
fn flat_pixels(room: &PartRoom, pixels: &[usize]) -> Option<Vec<usize>> {
    let normal = |k: usize| Vec3::from_array(room.normals.pixels()[k].0);
    let mean = pixels.iter().map(|&k| normal(k)).sum::<Vec3>().try_normalize()?;
    let flat: Vec<usize> = pixels.iter().copied().filter(|&k| normal(k).dot(mean) >= FLAT_COSINE).collect();
    (flat.len() as f64 >= FLAT_SHARE * pixels.len() as f64).then_some(flat)
}

/// The part of these pixels as a mirror, of the roughness whose reflection fits best.
fn mirror(room: &PartRoom, cache: &PhotoCache<'_>, pixels: &[usize]) -> Option<Mirror> {
    let fits = ROUGHNESSES.iter().filter_map(|roughness| {
        let pairs: Vec<(usize, [LinearRgb; 2])> = pixels
            .par_iter()
            .filter_map(|&k| Some((k, [room.photo.pixels()[k], mirrored(room, cache, k, *roughness)?])))
            .collect();
        let reach = (SLOW_REACH * room.photo.width() as f64).round() as usize;
        let found = comparison(room.photo.width(), reach, &pairs)?;
        let median_of =
            |which: usize| upper_median(&mut pairs.iter().map(|(_, pair)| pair[which].0).collect::<Vec<_>>());
        let [shown, seen_elsewhere] = [median_of(0), median_of(1)];
        let base_color = [0, 1, 2].map(|c| (shown[c] / seen_elsewhere[c].max(f32::MIN_POSITIVE)).clamp(0.0, 1.0));
        Some((found, Mirror { base_color, roughness: *roughness }))
    });
    let best = fits.max_by(|(a, _), (b, _)| a.correlation.total_cmp(&b.correlation))?;
    (best.0.correlation >= LEAST_CORRELATION && best.0.slope >= LEAST_SLOPE).then_some(best.1)
}

/// What pixel `k` shows if it is a mirror of this roughness; none unless the photo shows most of it.
fn mirrored(room: &PartRoom, cache: &PhotoCache<'_>, k: usize, roughness: f32) -> Option<LinearRgb> {
    let (x, y) = (k % room.photo.width(), k / room.photo.width());
    let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
    let towards = room.camera.direction(centre).as_vec3();
    let hit = room.world.first_hit(&Ray::endless(room.camera.position().as_vec3(), towards))?;
    let place = room.world.surface_hit(&hit);
    let Normal(normal) = room.normals.pixels()[k];
    let normal = Vec3::from_array(normal);
    let sampler = Sampler::new(0, [x as u32, y as u32], 0);
    let mut sum = Vec3::ZERO;
    let mut shown = 0;
    for ray in 0..RAYS {
        let [u, v, ..] = sampler.set(ray);
        let facet = facet(normal, roughness * roughness, [u, v]);
        let direction = towards - 2.0 * towards.dot(facet) * facet;
        let radiance = (direction.dot(normal) > 0.0).then(|| met(room, cache, &place, direction)).flatten();
        if let Some(radiance) = radiance {
            sum += radiance;
            shown += 1;
        }
    }
    (2 * shown > RAYS).then(|| LinearRgb((sum / shown as f32).to_array()))
}

fn met(room: &PartRoom, cache: &PhotoCache<'_>, place: &SurfaceHit, direction: Vec3) -> Option<Vec3> {
    let hit = room.world.first_hit(&place.spawn(direction))?;
    cache.radiance(&room.world.surface_hit(&hit), -direction)
}

/// A normal of the GGX distribution of width `alpha` about `normal` (Walter et al., EGSR 2007, equation 35).
fn facet(normal: Vec3, alpha: f32, [u, v]: [f32; 2]) -> Vec3 {
    let slope = alpha * (u / (1.0 - u).max(1e-6)).sqrt();
    let (sin, cos) = libm::sincosf(std::f32::consts::TAU * v);
    let (right, up) = normal.any_orthonormal_pair();
    (normal + slope * (cos * right + sin * up)).normalize()
}

/// How a part follows what it would mirror, in logarithms of radiance, slow changes apart.
struct Comparison {
    correlation: f64,
    slope: f64,
}

/// `pairs` holds pixels, in their order, with their own radiance and the mirrored one. Slow changes are means over
/// `reach` pixels on each side.
fn comparison(width: usize, reach: usize, pairs: &[(usize, [LinearRgb; 2])]) -> Option<Comparison> {
    if pairs.len() < LEAST_SHOWN {
        return None;
    }
    // Logarithms, so that one lamp in a mirror does not decide alone.
    let mean =
        pairs.iter().flat_map(|(_, pair)| pair).map(|color| color.luminance()).sum::<f64>() / (2 * pairs.len()) as f64;
    let darkest = (DARKEST * mean).max(f64::MIN_POSITIVE);
    let log = |color: LinearRgb| libm::log(color.luminance().max(darkest));
    let values: Vec<(usize, [f64; 2])> = pairs.iter().map(|(k, pair)| (*k, pair.map(log))).collect();
    let sums = RunningSums::new(width, &values);
    let mut square = [0.0_f64; 3];
    for (k, values_at) in &values {
        let slow = sums.mean_around([k % width, k / width], reach);
        let [own, other] = [0, 1].map(|which| (values_at[which] - slow[which]).clamp(-MOST_CONTRAST, MOST_CONTRAST));
        square[0] += own * own;
        square[1] += own * other;
        square[2] += other * other;
    }
    let correlation = square[1] / (square[0] * square[2]).sqrt();
    let slope = square[1] / square[2];
    (correlation.is_finite() && slope.is_finite()).then_some(Comparison { correlation, slope })
}

/// Sums over all pixels to the left of and above a corner of pixels (a summed-area table: Crow, SIGGRAPH 1984): of two
/// values, and of the number of pixels that have them.
struct RunningSums {
    /// Of pixels and of corners, one more in each row and column.
    size: [usize; 2],
    sums: Vec<[f64; 3]>,
}

impl RunningSums {
    /// `values` holds pixels in their order.
    fn new(width: usize, values: &[(usize, [f64; 2])]) -> Self {
        let height = values.last().map_or(0, |(k, _)| k / width + 1);
        let mut sums = vec![[0.0; 3]; (width + 1) * (height + 1)];
        for (k, [a, b]) in values {
            sums[(k / width + 1) * (width + 1) + k % width + 1] = [*a, *b, 1.0];
        }
        for (at, step) in (0..sums.len()).map(|at| (at, 1)).chain((0..sums.len()).map(|at| (at, width + 1))) {
            // Along rows, then along columns.
            let is_first = if step == 1 { at % (width + 1) == 0 } else { at < step };
            if !is_first {
                let before = sums[at - step];
                sums[at].iter_mut().zip(before).for_each(|(sum, before)| *sum += before);
            }
        }
        Self { size: [width, height], sums }
    }

    /// The mean of each value over the pixels that have them, at most `reach` away in row and column.
    fn mean_around(&self, [x, y]: [usize; 2], reach: usize) -> [f64; 2] {
        let [width, height] = self.size;
        let [left, right] = [x.saturating_sub(reach), (x + reach + 1).min(width)];
        let [top, bottom] = [y.saturating_sub(reach), (y + reach + 1).min(height)];
        let corner = |x: usize, y: usize| self.sums[y * (width + 1) + x];
        let corners = [corner(right, bottom), corner(left, bottom), corner(right, top), corner(left, top)];
        let [a, b, count] = [0, 1, 2].map(|of| corners[0][of] - corners[1][of] - corners[2][of] + corners[3][of]);
        [a / count, b / count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stripes over a slow gradient, and a surface that is `share` mirror and for the rest evenly bright.
    fn pairs(share: f32, noise: f32) -> Vec<(usize, [LinearRgb; 2])> {
        let grey = |v: f32| LinearRgb([v; 3]);
        (0..40 * 40)
            .map(|k| {
                let (x, y) = ((k % 40) as f32, (k / 40) as f32);
                let mirrored = 0.2 + 0.01 * y + if (k % 40) / 4 % 2 == 0 { 0.3 } else { 0.0 };
                let own = share * mirrored + (1.0 - share) * (0.4 + 0.01 * y) + noise * libm::sinf(12.9 * x + 78.2 * y);
                (k, [grey(own), grey(mirrored)])
            })
            .collect()
    }

    #[test]
    fn running_sums_are_those_of_pixels() {
        let values: Vec<(usize, [f64; 2])> =
            (0..60).filter(|k| k % 7 != 3).map(|k| (k, [(k * k % 11) as f64, k as f64])).collect();
        let sums = RunningSums::new(10, &values);
        for (k, _) in &values {
            let near = |other: usize| (other % 10).abs_diff(k % 10) <= 2 && (other / 10).abs_diff(k / 10) <= 2;
            let around: Vec<[f64; 2]> = values.iter().filter(|(other, _)| near(*other)).map(|(_, v)| *v).collect();
            let mean = [0, 1].map(|of| around.iter().map(|v| v[of]).sum::<f64>() / around.len() as f64);
            let found = sums.mean_around([k % 10, k / 10], 2);
            assert!(found.iter().zip(mean).all(|(found, mean)| (found - mean).abs() < 1e-9), "{k}: {found:?} {mean:?}");
        }
    }

    #[test]
    fn a_mirror_differs_from_gloss_and_from_a_common_gradient() {
        let mirror = comparison(40, 7, &pairs(0.9, 0.01)).unwrap();
        assert!(mirror.correlation > 0.95 && mirror.slope > 0.8, "{} {}", mirror.correlation, mirror.slope);
        let gloss = comparison(40, 7, &pairs(0.1, 0.0)).unwrap();
        assert!(gloss.slope < LEAST_SLOPE, "{}", gloss.slope);
        let matt = comparison(40, 7, &pairs(0.0, 0.01)).unwrap();
        assert!(matt.correlation < LEAST_CORRELATION, "{}", matt.correlation);
        assert!(comparison(40, 7, &pairs(0.9, 0.0)[..LEAST_SHOWN - 1]).is_none());
    }
}
