//! Statistics for comparing noisy pictures.

use mateval_image::{LinearRgb, Picture};
use mateval_scene::Camera;
use mateval_tracer::{RenderSettings, World, render};

/// Independent renders of one view.
pub struct Renders(Vec<Picture<LinearRgb>>);

/// A mean with its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Its standard error.
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

    /// The individual renders.
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

    /// The mean picture.
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
