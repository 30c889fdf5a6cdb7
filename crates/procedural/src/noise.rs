//! The noises of MaterialX' standard library, which are those of Open Shading Language, with their derivatives.
//!
//! All of them hash the whole numbers of a lattice's cells, by Bob Jenkins' `lookup3`
//! (burtleburtle.net/bob/c/lookup3.c, public domain), as Open Shading Language seeds it. [`cell`] is constant in each
//! cell. [`perlin`] is Perlin's improved gradient noise in two dimensions (Perlin 2002, "Improving noise"), with OSL's
//! gradients and scale, of which [`fractal`] sums octaves. [`distance`] and [`nearest_cell`] are Worley's cellular
//! noise in two dimensions (Worley 1996, "A cellular texture basis function"): each cell has one random point.

/// A number from 0 to 1 that is constant in each cell.
pub fn cell(x: f64, y: f64) -> f64 {
    to_unit(hash2(cell_of(x).0, cell_of(y).0))
}

/// Component 0, 1 or 2 of a vector from 0 to 1 that is constant in each cell, given by its whole numbers.
fn component_at(x: i32, y: i32, component: i32) -> f64 {
    to_unit(hash3(x, y, component))
}

/// What brings the noise to -1 to 1, as OSL measured it.
const SCALE: f64 = 0.6616;

/// Which noise of a place is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    /// The noise of floats.
    Scalar,
    /// Component 0, 1 or 2 of the noise of vectors and colours.
    Component(u8),
}

impl Channel {
    /// The bits of a cell's hash that choose its gradient.
    fn bits(self, hash: u32) -> u32 {
        match self {
            Self::Scalar => hash,
            Self::Component(at) => hash >> (8 * u32::from(at)),
        }
    }
}

/// One of the eight gradients (±1, ±2) and (±2, ±1).
fn gradient(bits: u32) -> [f64; 2] {
    let sign = |bit: u32| if bits & bit == 0 { 1.0 } else { -1.0 };
    let (short, long) = (sign(1), 2.0 * sign(2));
    if bits & 4 == 0 { [short, long] } else { [long, short] }
}

fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn fade_slope(t: f64) -> f64 {
    30.0 * t * t * (t - 1.0) * (t - 1.0)
}

/// The noise, and its derivatives in x and y.
pub fn perlin(x: f64, y: f64, channel: Channel) -> [f64; 3] {
    let ((i, fx), (j, fy)) = (cell_of(x), cell_of(y));
    let corner = |di: i32, dj: i32| {
        let [gx, gy] = gradient(channel.bits(hash2(i.wrapping_add(di), j.wrapping_add(dj))));
        [gx, gy, gx * (fx - f64::from(di)) + gy * (fy - f64::from(dj))]
    };
    let [n00, n10, n01, n11] = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
    let (s, t) = (fade(fx), fade(fy));
    let blend = |k: usize| (1.0 - t) * (n00[k] * (1.0 - s) + n10[k] * s) + t * (n01[k] * (1.0 - s) + n11[k] * s);
    let along_x = (1.0 - t) * (n10[2] - n00[2]) + t * (n11[2] - n01[2]);
    let along_y = (1.0 - s) * (n01[2] - n00[2]) + s * (n11[2] - n10[2]);
    [SCALE * blend(2), SCALE * (blend(0) + fade_slope(fx) * along_x), SCALE * (blend(1) + fade_slope(fy) * along_y)]
}

/// A sum of octaves: each has `lacunarity` times the frequency and `diminish` times the amplitude of the one before.
/// Returns the sum and its derivatives in x, y, lacunarity and diminish.
pub fn fractal(x: f64, y: f64, octaves: i32, lacunarity: f64, diminish: f64, channel: Channel) -> [f64; 5] {
    let mut sum = [0.0; 5];
    // The amplitude and the frequency, and their derivatives in diminish and lacunarity.
    let (mut amplitude, mut amplitude_slope) = (1.0, 0.0);
    let (mut frequency, mut frequency_slope) = (1.0, 0.0);
    for _ in 0..octaves {
        let [value, dx, dy] = perlin(x * frequency, y * frequency, channel);
        sum[0] += amplitude * value;
        sum[1] += amplitude * dx * frequency;
        sum[2] += amplitude * dy * frequency;
        sum[3] += amplitude * (dx * x + dy * y) * frequency_slope;
        sum[4] += amplitude_slope * value;
        amplitude_slope = amplitude_slope * diminish + amplitude;
        amplitude *= diminish;
        frequency_slope = frequency_slope * lacunarity + frequency;
        frequency *= lacunarity;
    }
    sum
}

/// A point of a neighbouring cell.
#[derive(Clone, Copy)]
struct Point {
    /// From the place asked for to the point.
    offset: [f64; 2],
    /// The derivative of `offset` in the jitter.
    slope: [f64; 2],
    /// The squared length of `offset`.
    square: f64,
}

impl Point {
    const NONE: Self = Self { offset: [0.0; 2], slope: [0.0; 2], square: 1e6 };
}

/// The three nearest points of the nine cells around a place, nearest first. Ties keep the order of the cells.
fn nearest(x: f64, y: f64, jitter: f64) -> [Point; 3] {
    let ((i, fx), (j, fy)) = (cell_of(x), cell_of(y));
    let mut found = [Point::NONE; 3];
    for di in -1..=1 {
        for dj in -1..=1 {
            let (ci, cj) = (i.wrapping_add(di), j.wrapping_add(dj));
            let slope = [component_at(ci, cj, 0) - 0.5, component_at(ci, cj, 1) - 0.5];
            let offset = [f64::from(di) + 0.5 + slope[0] * jitter - fx, f64::from(dj) + 0.5 + slope[1] * jitter - fy];
            let square = offset[0] * offset[0] + offset[1] * offset[1];
            insert(&mut found, Point { offset, slope, square });
        }
    }
    found
}

fn insert(found: &mut [Point; 3], point: Point) {
    let at = found.iter().position(|other| point.square < other.square);
    if let Some(at) = at {
        found[at..].rotate_right(1);
        found[at] = point;
    }
}

/// The distance to the nearest point (`rank` 0), the second or the third, and its derivatives in x, y and the jitter.
pub fn distance(x: f64, y: f64, jitter: f64, rank: usize) -> [f64; 4] {
    let Point { offset, slope, square } = nearest(x, y, jitter)[rank];
    let distance = square.sqrt();
    if distance == 0.0 {
        return [0.0; 4];
    }
    let [ux, uy] = [offset[0] / distance, offset[1] / distance];
    [distance, -ux, -uy, ux * slope[0] + uy * slope[1]]
}

/// The random number of the nearest point's cell, from 0 to 1.
pub fn nearest_cell(x: f64, y: f64, jitter: f64, channel: Channel) -> f64 {
    let [dx, dy] = nearest(x, y, jitter)[0].offset;
    match channel {
        Channel::Scalar => cell(x + dx, y + dy),
        Channel::Component(at) => component_at(cell_of(x + dx).0, cell_of(y + dy).0, i32::from(at)),
    }
}

/// The state that `lookup3` begins with: `0xdeadbeef`, four bytes a word, and OSL's 13.
fn seed(words: u32) -> u32 {
    0xdead_beef_u32.wrapping_add(4 * words).wrapping_add(13)
}

/// The last step of `lookup3`.
fn finish(mut a: u32, mut b: u32, mut c: u32) -> u32 {
    let step = |target: u32, by: u32, turn: u32| (target ^ by).wrapping_sub(by.rotate_left(turn));
    c = step(c, b, 14);
    a = step(a, c, 11);
    b = step(b, a, 25);
    c = step(c, b, 16);
    a = step(a, c, 4);
    b = step(b, a, 14);
    step(c, b, 24)
}

/// The hash of two whole numbers.
fn hash2(x: i32, y: i32) -> u32 {
    let start = seed(2);
    finish(start.wrapping_add(x.cast_unsigned()), start.wrapping_add(y.cast_unsigned()), start)
}

/// The hash of three whole numbers.
fn hash3(x: i32, y: i32, z: i32) -> u32 {
    let start = seed(3);
    let add = |word: i32| start.wrapping_add(word.cast_unsigned());
    finish(add(x), add(y), add(z))
}

/// A hash as a number from 0 to 1.
fn to_unit(hash: u32) -> f64 {
    f64::from(hash) / f64::from(u32::MAX)
}

/// The lattice cell that holds a coordinate, and the place within it. Beyond the range of whole numbers cells repeat.
fn cell_of(x: f64) -> (i32, f64) {
    let floor = x.floor();
    #[allow(clippy::cast_possible_truncation, reason = "cells repeat beyond the range")]
    let cell = floor as i64 as i32;
    (cell, x - floor)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn neighbouring_cells_have_unrelated_hashes() {
        let mut bits = 0;
        for x in -20..20 {
            for y in -20..20 {
                bits += (hash2(x, y) ^ hash2(x + 1, y)).count_ones() + (hash3(x, y, 0) ^ hash3(x, y, 1)).count_ones();
            }
        }
        let mean = f64::from(bits) / 3200.0;
        assert!((mean - 16.0).abs() < 0.2, "{mean}");
        // The twin: a hash without its last step keeps its neighbours.
        assert!((seed(2) ^ (seed(2) + 1)).count_ones() < 4);
    }

    #[test]
    fn cells_hold_their_coordinates() {
        assert_eq!(cell_of(-0.25), (-1, 0.75));
        assert_eq!(cell_of(3.0), (3, 0.0));
    }

    #[test]
    fn a_cell_is_constant_and_differs_from_its_neighbour() {
        assert_eq!(cell(2.01, -3.99), cell(2.99, -3.01));
        assert_ne!(cell(2.5, 0.5), cell(3.5, 0.5));
    }

    #[test]
    fn numbers_are_uniform() {
        let numbers: Vec<f64> = (0..10_000).map(|i| cell(f64::from(i % 100), f64::from(i / 100))).collect();
        let mean = numbers.iter().sum::<f64>() / 1e4;
        let variance = numbers.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / 1e4;
        // Standard errors: 0.003 and 0.0007.
        assert!((mean - 0.5).abs() < 0.012 && (variance - 1.0 / 12.0).abs() < 0.003, "{mean} {variance}");
    }

    #[test]
    fn lattice_points_are_zero() {
        for (i, j) in [(0, 0), (3, -7), (-100, 12)] {
            assert_eq!(perlin(f64::from(i), f64::from(j), Channel::Scalar)[0], 0.0);
        }
    }

    #[test]
    fn one_octave_is_the_noise() {
        let [noise, ..] = perlin(0.3, -1.7, Channel::Component(2));
        assert_eq!(fractal(0.3, -1.7, 1, 3.0, 0.7, Channel::Component(2))[0], noise);
        assert_eq!(fractal(0.3, -1.7, 0, 3.0, 0.7, Channel::Scalar), [0.0; 5]);
        assert_ne!(fractal(0.3, -1.7, 2, 3.0, 0.7, Channel::Component(2))[0], noise);
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_central_differences(
            x in -9.0..9.0_f64, y in -9.0..9.0_f64, lacunarity in 1.5..2.5_f64, diminish in 0.2..0.8_f64,
        ) {
            let at = [x, y, lacunarity, diminish];
            let value = |p: [f64; 4]| fractal(p[0], p[1], 3, p[2], p[3], Channel::Component(1))[0];
            let slopes = fractal(x, y, 3, lacunarity, diminish, Channel::Component(1));
            for k in 0..4 {
                let (mut above, mut below) = (at, at);
                above[k] += 1e-6;
                below[k] -= 1e-6;
                let difference = (value(above) - value(below)) / 2e-6;
                prop_assert!((difference - slopes[k + 1]).abs() < 1e-5, "{k}: {difference} {}", slopes[k + 1]);
            }
        }
    }

    /// Without jitter the points are the cells' centres.
    #[test]
    fn without_jitter_distances_are_known() {
        assert_eq!(distance(0.5, 0.5, 0.0, 0)[0], 0.0);
        assert_eq!(distance(0.5, 0.75, 0.0, 0)[0], 0.25);
        assert_eq!(distance(0.5, 0.75, 0.0, 1)[0], 0.75);
        assert_ne!(distance(0.5, 0.75, 1.0, 0)[0], 0.25);
    }

    proptest! {
        #[test]
        fn distances_ascend_and_derivatives_are_those_of_central_differences(
            x in -9.0..9.0_f64, y in -9.0..9.0_f64, jitter in 0.3..1.0_f64,
        ) {
            let all = [0, 1, 2].map(|rank| distance(x, y, jitter, rank)[0]);
            prop_assert!(all[0] <= all[1] && all[1] <= all[2]);
            // Away from places that are equally far from two points, and from points.
            prop_assume!(all[0] > 1e-3 && all[1] - all[0] > 1e-3);
            let at = [x, y, jitter];
            let slopes = distance(x, y, jitter, 0);
            for k in 0..3 {
                let (mut above, mut below) = (at, at);
                above[k] += 1e-7;
                below[k] -= 1e-7;
                let value = |p: [f64; 3]| distance(p[0], p[1], p[2], 0)[0];
                let difference = (value(above) - value(below)) / 2e-7;
                prop_assert!((difference - slopes[k + 1]).abs() < 1e-4, "{k}: {difference} {}", slopes[k + 1]);
            }
        }

        #[test]
        fn the_nearest_cell_is_constant_around_its_point(x in -9.0..9.0_f64, y in -9.0..9.0_f64) {
            let [d, dx, dy, _] = distance(x, y, 1.0, 0);
            // Halfway to the nearest point the same point is nearest.
            let (nearer_x, nearer_y) = (x - 0.5 * d * dx, y - 0.5 * d * dy);
            let numbers = [(x, y), (nearer_x, nearer_y)].map(|(x, y)| nearest_cell(x, y, 1.0, Channel::Scalar));
            prop_assume!(cell_of(x).0 == cell_of(nearer_x).0 && cell_of(y).0 == cell_of(nearer_y).0);
            prop_assert_eq!(numbers[0], numbers[1]);
        }
    }
}
