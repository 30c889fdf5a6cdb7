//! Random numbers that depend on seed, pixel and sample index alone, and what is drawn with them: choices, points and
//! directions.
//!
//! Owen-scrambled Sobol points (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020) in sets of four dimensions;
//! each set of each pixel has its own scrambling seed. After three scatterings, plain hashes follow. Two halves of one
//! sequence are correlated, so independent halves need two seeds.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, TAU};

use glam::{Vec2, Vec3};
use mateval_dataset::splitmix64;

/// The random numbers of one sample of one pixel, in sets.
///
/// Set 0 is the place in the pixel, or in the cell of a shared plane. At scattering s, from 0, a path takes set 1 + 2 s
/// for its light sample, and set 2 + 2 s for its BSDF sample and Russian roulette.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    key: u64,
    index: u32,
}

/// The last set of the first three scatterings.
const LAST_SPREAD_SET: u32 = 6;

/// log2 of the samples in one sequence; later samples start another sequence.
const SEQUENCE_BITS: u32 = 16;

impl Sampler {
    /// The numbers for sample `index` of the pixel in column `pixel[0]`, row `pixel[1]`.
    pub fn new(seed: u64, pixel: [u32; 2], index: u32) -> Self {
        let place = (u64::from(pixel[0]) << 32) | u64::from(pixel[1]);
        let sequence = u64::from(index >> SEQUENCE_BITS);
        let key = mix(mix(mix(seed) ^ place) ^ sequence);
        Self { key, index: index & ((1 << SEQUENCE_BITS) - 1) }
    }

    /// Four numbers in [0, 1). Those of the first sets are stratified over the samples of the pixel. Sets are
    /// independent of each other.
    pub fn set(&self, set: u32) -> [f32; 4] {
        if set > LAST_SPREAD_SET {
            return self.unordered(set);
        }
        sobol_burley::sample_4d(self.index, 0, mix(self.key ^ u64::from(set)) as u32)
    }

    /// Four unstratified numbers in [0, 1). Once a path has scattered several times, stratification no longer shows in
    /// the pixel.
    fn unordered(&self, set: u32) -> [f32; 4] {
        let first = mix(mix(self.key ^ u64::from(set)) ^ u64::from(self.index));
        let second = mix(first);
        let unit = |bits: u64| (bits & 0xff_ffff) as f32 / (1 << 24) as f32;
        [unit(first), unit(first >> 32), unit(second), unit(second >> 32)]
    }

    /// A salt for `unit_hash`, different for each `stream`.
    pub(crate) fn salt(&self, stream: u32) -> u32 {
        mix(mix(self.key ^ (1 << 63) ^ u64::from(stream)) ^ u64::from(self.index)) as u32
    }
}

/// A number in [0, 1), a hash of two integers.
pub(crate) fn unit_hash(a: u32, b: u32) -> f32 {
    (mix((u64::from(a) << 32) | u64::from(b)) >> 40) as f32 / (1 << 24) as f32
}

fn mix(value: u64) -> u64 {
    splitmix64::number(value, 0)
}

/// A discrete distribution: cumulative weights, scaled to end at 1.
#[derive(Clone, Debug)]
pub(crate) struct Distribution {
    /// `cumulative[k]` is the probability of all choices before k; there is one more entry than choices.
    cumulative: Vec<f32>,
    total: f64,
}

impl Distribution {
    /// Builds the distribution from finite weights of at least 0. If all are zero, all choices are equally likely.
    pub(crate) fn new(weights: impl Iterator<Item = f64>) -> Self {
        let mut sums = vec![0.0_f64];
        let mut total = 0.0;
        for weight in weights {
            total += weight;
            sums.push(total);
        }
        let count = (sums.len() - 1) as f64;
        let scaled = |(k, sum): (usize, f64)| if total > 0.0 { sum / total } else { k as f64 / count };
        Self { cumulative: sums.into_iter().enumerate().map(|entry| scaled(entry) as f32).collect(), total }
    }

    /// The sum of the weights.
    pub(crate) fn total(&self) -> f64 {
        self.total
    }

    /// The choice for `u` in [0, 1), and the position of u within that choice, rescaled to [0, 1). A choice of weight
    /// zero is never made.
    pub(crate) fn sample(&self, u: f32) -> (usize, f32) {
        let choice = self.cumulative.partition_point(|&before| before <= u) - 1;
        let choice = choice.min(self.cumulative.len() - 2);
        let rest = (u - self.cumulative[choice]) / self.probability(choice);
        (choice, rest.clamp(0.0, 1.0 - f32::EPSILON))
    }

    /// The probability of `choice`.
    pub(crate) fn probability(&self, choice: usize) -> f32 {
        self.cumulative[choice + 1] - self.cumulative[choice]
    }
}

/// A uniform point of the unit disk. Shirley and Chiu, "A Low Distortion Map Between Disk and Square" (1997).
pub(crate) fn disk(u: [f32; 2]) -> Vec2 {
    let (x, y) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if x == 0.0 && y == 0.0 {
        return Vec2::ZERO;
    }
    if x.abs() > y.abs() {
        let (sin, cos) = sin_cos_near_zero(FRAC_PI_4 * (y / x));
        Vec2::new(x * cos, x * sin)
    } else {
        let (sin, cos) = sin_cos_near_zero(FRAC_PI_4 * (x / y));
        Vec2::new(y * sin, y * cos)
    }
}

/// Sine and cosine of `turns` (0 to 1) full turns. Computed from sums and products only, so every machine gets the same
/// bits, in a third of the time of the general functions.
pub(crate) fn circle(turns: f32) -> (f32, f32) {
    // The nearest quarter turn; the remainder is exact.
    let quarter = (4.0 * turns + 0.5) as u32;
    let (sin, cos) = sin_cos_near_zero(TAU * (turns - 0.25 * quarter as f32));
    match quarter & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// Taylor series for angles of up to an eighth of a turn, where the truncation error is below the rounding of f32.
fn sin_cos_near_zero(angle: f32) -> (f32, f32) {
    let x2 = angle * angle;
    let sin = 1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 + x2 / 362_880.0)));
    let cos = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 / 40_320.0)));
    (angle * sin, cos)
}

/// A direction of the upper hemisphere with density cos / pi.
pub(crate) fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let p = disk(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}

/// The density of [`cosine_hemisphere`] per solid angle.
pub(crate) fn cosine_density(z: f32) -> f32 {
    z.max(0.0) * FRAC_1_PI
}

/// A uniform direction with density 1 / (4 pi).
pub(crate) fn sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = circle(u[1]);
    Vec3::new(radius * cos, radius * sin, z)
}

/// Barycentric weights of a uniform point in a triangle.
pub(crate) fn triangle(u: [f32; 2]) -> Vec3 {
    let root = u[0].sqrt();
    Vec3::new(1.0 - root, root * (1.0 - u[1]), root * u[1])
}

/// Three orthonormal vectors; z is the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    x: Vec3,
    y: Vec3,
    z: Vec3,
}

impl Frame {
    /// A frame whose z axis is `normal` (unit length). Duff et al., "Building an Orthonormal Basis, Revisited" (JCGT
    /// 2017).
    pub(crate) fn around(normal: Vec3) -> Self {
        let sign = 1.0_f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        let x = Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
        let y = Vec3::new(b, sign + normal.y * normal.y * a, -normal.y);
        Self { x, y, z: normal }
    }

    /// Converts a vector from world space to this frame.
    pub(crate) fn local_from_world(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// Converts a vector from this frame to world space.
    pub(crate) fn world_from_local(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sixteen samples fall into sixteen slices along each dimension: the property of Sobol points.
    #[test]
    fn samples_of_a_pixel_are_stratified() {
        for dimension in 0..4 {
            let mut seen = [0; 16];
            for index in 0..16 {
                seen[(Sampler::new(3, [5, 9], index).set(2)[dimension] * 16.0) as usize] += 1;
            }
            assert_eq!(seen, [1; 16]);
        }
    }

    /// Means of two seeds over many pixels are uncorrelated, as the halves of a render must be. The twin shows that two
    /// halves of one sequence are correlated.
    #[test]
    fn seeds_are_independent_and_halves_of_one_sequence_are_not() {
        let mean = |seed: u64, pixel: u32, range: std::ops::Range<u32>| -> f64 {
            let n = f64::from(range.end - range.start);
            range.map(|i| f64::from(Sampler::new(seed, [pixel, 0], i).set(1)[0]) - 0.5).sum::<f64>() / n
        };
        let correlation = |a: &dyn Fn(u32) -> f64, b: &dyn Fn(u32) -> f64| {
            let sums = (0..4000).fold([0.0; 3], |[ab, aa, bb], pixel| {
                let (x, y) = (a(pixel), b(pixel));
                [ab + x * y, aa + x * x, bb + y * y]
            });
            sums[0] / (sums[1] * sums[2]).sqrt()
        };
        let independent = correlation(&|p| mean(1, p, 0..8), &|p| mean(2, p, 0..8));
        assert!(independent.abs() < 0.06, "{independent}");
        let halves = correlation(&|p| mean(1, p, 0..8), &|p| mean(1, p, 8..16));
        assert!(halves < -0.2, "{halves}");
    }

    #[test]
    fn the_sequence_goes_on_after_65536_samples() {
        let far = Sampler::new(1, [0, 0], 1 << 16).set(0);
        assert_ne!(far, Sampler::new(1, [0, 0], 0).set(0));
    }

    #[test]
    fn choices_follow_their_weights() {
        let distribution = Distribution::new([1.0, 0.0, 3.0].into_iter());
        let mut counts = [0; 3];
        for k in 0..1000 {
            counts[distribution.sample((k as f32 + 0.5) / 1000.0).0] += 1;
        }
        assert_eq!(counts, [250, 0, 750]);
        assert_eq!(distribution.sample(0.625), (2, 0.5));
        assert_eq!(distribution.probability(2), 0.75);
    }

    #[test]
    fn weights_of_zero_alone_are_all_alike() {
        let distribution = Distribution::new([0.0, 0.0].into_iter());
        assert_eq!((distribution.sample(0.75).0, distribution.probability(0)), (1, 0.5));
    }

    #[test]
    fn cosine_hemisphere_has_the_moments_of_its_density() {
        let n = 4096;
        let mean = (0..n).map(|i| cosine_hemisphere(sobol(i))).sum::<Vec3>() / n as f32;
        assert!((mean - Vec3::new(0.0, 0.0, 2.0 / 3.0)).length() < 2e-3, "{mean}");
    }

    #[test]
    fn triangle_weights_average_to_a_third() {
        let n = 4096;
        let mean = (0..n).map(|i| triangle(sobol(i))).sum::<Vec3>() / n as f32;
        assert!((mean - Vec3::splat(1.0 / 3.0)).length() < 2e-3, "{mean}");
    }

    #[test]
    fn a_turn_goes_round() {
        for step in 0..=4000 {
            let turns = step as f32 / 4000.0;
            let (sin, cos) = circle(turns);
            let angle = std::f64::consts::TAU * f64::from(turns);
            assert!((f64::from(sin) - libm::sin(angle)).abs() < 2e-7, "{turns}");
            assert!((f64::from(cos) - libm::cos(angle)).abs() < 2e-7, "{turns}");
        }
    }

    fn sobol(index: u32) -> [f32; 2] {
        let [x, y, ..] = sobol_burley::sample_4d(index, 0, 1);
        [x, y]
    }

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for normal in [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(0.36, -0.48, -0.8), Vec3::new(1e-20, 0.0, -1.0)] {
            let frame = Frame::around(normal);
            assert!((frame.x.cross(frame.y) - normal).length() < 1e-6);
            assert!(frame.x.dot(frame.y).abs() < 1e-6 && (frame.x.length() - 1.0).abs() < 1e-6);
            let v = Vec3::new(0.3, -0.2, 0.7);
            assert!((frame.world_from_local(frame.local_from_world(v)) - v).length() < 1e-6);
        }
    }
}
