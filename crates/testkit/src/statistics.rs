//! Noisy pictures: statistics that compare them, and pictures whose expectation is known, for tests of metrics that
//! remove noise.

use mateval_dataset::Camera;
use mateval_dataset::splitmix64::{INCREMENT, number};
use mateval_image::{LinearRgb, Picture};
use mateval_tracer::{RenderSettings, World, render};

/// Independent renders of one view.
pub struct Renders(Vec<Picture<LinearRgb>>);

/// A mean with its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

impl Estimate {
    /// An estimate from independent values of one expectation.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
        Self { mean, error: (variance / n).sqrt() }
    }

    /// The distance above `expected`, in standard errors.
    pub fn z(&self, expected: f64) -> f64 {
        (self.mean - expected) / self.error.max(1e-12)
    }

    /// The distance between two estimates, in standard errors.
    pub fn z_against(&self, other: &Self) -> f64 {
        (self.mean - other.mean) / self.error.hypot(other.error).max(1e-12)
    }
}

/// Wilson and Hilferty's approximation: a chi-square over its degrees of freedom as a standard normal.
pub fn chi_square_z(mean: f64, freedom: f64) -> f64 {
    (mean.cbrt() - (1.0 - 2.0 / (9.0 * freedom))) / (2.0 / (9.0 * freedom)).sqrt()
}

/// The deviation of counts of `total` samples from the cells' `probabilities`, as a standard normal: Pearson's chi-square
/// over cells with at least 10 expected samples. The other cells are pooled with the samples that fell into none.
pub fn counts_z(counts: &[f64], probabilities: &[f64], total: u32) -> f64 {
    let n = f64::from(total);
    let (mut statistic, mut freedom) = (0.0, 0.0_f64);
    let mut pooled = [n - counts.iter().sum::<f64>(), n * (1.0 - probabilities.iter().sum::<f64>())];
    for (found, expected) in counts.iter().zip(probabilities.iter().map(|probability| n * probability)) {
        if expected >= 10.0 {
            statistic += (found - expected).powi(2) / expected;
            freedom += 1.0;
        } else {
            pooled = [pooled[0] + found, pooled[1] + expected];
        }
    }
    statistic += (pooled[0] - pooled[1]).powi(2) / pooled[1].max(10.0);
    let freedom = freedom.max(1.0);
    chi_square_z(statistic / freedom, freedom)
}

impl Renders {
    /// `count` renders with different seeds.
    pub fn new(world: &World, camera: &Camera, settings: RenderSettings, count: u64) -> Self {
        let one = |seed: u64| {
            let settings = RenderSettings { seed: settings.seed * 1000 + seed, ..settings };
            let done = render(world, camera, &settings, &|_, _| ()).unwrap();
            assert_eq!(done.stats.not_finite, 0);
            done.picture
        };
        Self((0..count).map(one).collect())
    }

    /// Takes pictures that are independent estimates of the same view.
    pub fn from_pictures(pictures: impl Iterator<Item = Picture<LinearRgb>>) -> Self {
        Self(pictures.collect())
    }

    /// The renders of the same scene with all lights scaled by `factor`: light is linear in emission.
    pub fn scaled(&self, factor: f32) -> Self {
        Self(self.0.iter().map(|picture| picture.map(|pixel| LinearRgb(pixel.0.map(|v| factor * v)))).collect())
    }

    pub fn pictures(&self) -> &[Picture<LinearRgb>] {
        &self.0
    }

    /// The mean of all channels over a rectangle of pixels.
    pub fn region(&self, x: std::ops::Range<usize>, y: std::ops::Range<usize>) -> Estimate {
        let mean = |picture: &Picture<LinearRgb>| {
            let pixels = y.clone().flat_map(|y| x.clone().map(move |x| (x, y)));
            let sum: f64 = pixels.map(|(x, y)| picture.get(x, y).0.iter().map(|&v| f64::from(v)).sum::<f64>()).sum();
            sum / (3 * x.len() * y.len()) as f64
        };
        Estimate::of(&self.0.iter().map(mean).collect::<Vec<_>>())
    }

    /// The mean of the whole picture.
    pub fn whole(&self) -> Estimate {
        self.region(0..self.0[0].width(), 0..self.0[0].height())
    }

    pub fn picture(&self) -> Picture<LinearRgb> {
        let n = self.0.len() as f32;
        Picture::from_fn(self.0[0].width(), self.0[0].height(), |x, y| {
            let mut sum = [0.0; 3];
            for picture in &self.0 {
                for (sum, value) in sum.iter_mut().zip(picture.get(x, y).0) {
                    *sum += value / n;
                }
            }
            LinearRgb(sum)
        })
    }
}

/// The distribution of single samples about their mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scatter {
    /// The sum of four uniform values.
    GaussianLike,
    /// As in path tracing: nine of ten samples find no light, the tenth finds ten times the mean.
    HeavyTailed,
}

pub const SCATTERS: [Scatter; 2] = [Scatter::GaussianLike, Scatter::HeavyTailed];

/// How a picture is rendered.
#[derive(Clone, Copy, Debug)]
pub struct Render<'a> {
    /// The distribution of its samples.
    pub scatter: Scatter,
    /// The share of each sample that scatters.
    pub strength: f64,
    pub samples: u32,
    /// If given, three of four samples are shared by all pixels of a block, in all views.
    pub blocks: Option<&'a Picture<u32>>,
    /// The view; two views have different noise except in shared samples.
    pub view: u64,
}

impl Render<'_> {
    /// A noisy picture whose expectation is `truth`.
    pub fn picture(&self, truth: &Picture<LinearRgb>, seed: u64) -> Picture<LinearRgb> {
        Picture::from_fn(truth.width(), truth.height(), |x, y| {
            let own = 1 + (self.view << 40 | (y as u64) << 20 | x as u64);
            let block = self.blocks.map_or(own, |blocks| u64::from(blocks.get(x, y)) << 44);
            let factor = |channel: u64| {
                let place = |sample: u32| if sample % 4 < 3 { block } else { own };
                let value = |sample| self.sample(hash(hash(seed, place(sample)), u64::from(sample) << 2 | channel));
                (0..self.samples).map(value).sum::<f64>() / f64::from(self.samples)
            };
            let LinearRgb(rgb) = truth.get(x, y);
            LinearRgb(std::array::from_fn(|c| (f64::from(rgb[c]) * factor(c as u64)) as f32))
        })
    }

    /// One sample's factor, of mean 1.
    fn sample(&self, random: u64) -> f64 {
        let unit = |shift: u32| (f64::from((random >> shift) as u16) + 0.5) / 65536.0;
        let factor = match self.scatter {
            // The variance of the sum is 1/3.
            Scatter::GaussianLike => 1.0 + 3.0_f64.sqrt() * (unit(0) + unit(16) + unit(32) + unit(48) - 2.0),
            Scatter::HeavyTailed => f64::from(u8::from(random.is_multiple_of(10))) * 10.0,
        };
        1.0 + self.strength * (factor - 1.0)
    }
}

/// Mixes two numbers into one.
fn hash(state: u64, word: u64) -> u64 {
    let mixed = state ^ word.wrapping_add(1).wrapping_mul(INCREMENT);
    number(mixed.wrapping_sub(INCREMENT), 0)
}

/// A picture with gradients and waves, `side` pixels square, values of 0.05 to 0.95.
pub fn waves(side: usize) -> Picture<LinearRgb> {
    Picture::from_fn(side, side, |x, y| {
        let (u, v) = ((x as f32 + 0.5) / side as f32, (y as f32 + 0.5) / side as f32);
        LinearRgb([0.05 + 0.9 * u, 0.05 + 0.5 * v, 0.3 + 0.25 * (0.7 * x as f32).sin() * (0.5 * y as f32).cos()])
    })
}

pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt())
}
