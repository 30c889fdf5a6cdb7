//! Random numbers that depend on seed, pixel and sample index alone.
//!
//! Owen-scrambled Sobol points (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020) in sets of four dimensions;
//! each set of each pixel has its own scrambling seed. After three scatterings, plain hashes follow. Two halves of one
//! sequence are correlated, so independent halves need two seeds.

use mateval_scene::splitmix64;

/// The random numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    key: u64,
    index: u32,
}

/// The sets of the pixel position and of the first three surfaces.
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
}
