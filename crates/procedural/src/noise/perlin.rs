//! Perlin's improved gradient noise in two dimensions (Perlin 2002, "Improving noise"), with OSL's gradients and scale,
//! and sums of its octaves.

use super::hash::{cell_of, hash2};

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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
}
