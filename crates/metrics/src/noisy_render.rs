//! A noisy render in four independent quarters, encoded without the bias that a curve over noisy values has.
//!
//! Clipping and sRGB encoding do not commute with means: the expectation of an encoded render f(a) is f(μ) +
//! f''(μ) var(a) / 2 + ..., and that term is twice as large for each of two quarters as for their mean. So
//! 2 f((a1 + a2) / 2) - (f(a1) + f(a2)) / 2 is free of it (the jackknife, Quenouille 1956), and it depends on one half
//! alone, so that both halves stay independent.
//!
//! The difference (f(a1) - f(a2)) / 2 has the variance and the covariances of the half's noise to first order, mean 0,
//! and no correlation with the half: it shows the noise of one half without the other.

use mateval_image::{LinearRgb, Picture, SrgbRgb};

use crate::pixel::{Pixel, check_size, size_of};
use crate::{Halves, MetricError};

/// Half of a render.
#[derive(Clone, Debug, PartialEq)]
pub struct NoisyHalf<P> {
    /// The encoded half, free of the encoding's bias to first order.
    pub estimate: Picture<P>,
    /// A picture with noise like the estimate's around 0.
    pub noise: Picture<P>,
}

/// A render.
#[derive(Clone, Debug, PartialEq)]
pub struct NoisyRender<P> {
    /// One half.
    pub a: NoisyHalf<P>,
    /// The other half.
    pub b: NoisyHalf<P>,
    /// Noise that both quarters of a half share, which `noise` therefore does not show: that of the first half minus
    /// that of the second. None if there is none.
    pub shared: Option<Picture<P>>,
}

impl NoisyHalf<SrgbRgb> {
    /// A half from its two quarters, each encoded by `encode`, which must treat each pixel alone. Fails if their sizes
    /// differ.
    pub fn encoded(
        quarters: [&Picture<LinearRgb>; 2],
        encode: impl Fn(LinearRgb) -> SrgbRgb,
    ) -> Result<Self, MetricError> {
        let [first, second] = quarters;
        check_size(size_of(first), "half's second quarter", size_of(second))?;
        let combined = |combine: fn([f32; 3]) -> f32| {
            let pairs = first.pixels().iter().zip(second.pixels());
            let pixels = pairs.map(|(&first, &second)| {
                let [a, b, mean] = [first, second, mean_of(first, second)].map(|linear| encode(linear).0);
                SrgbRgb([0, 1, 2].map(|c| combine([a[c], b[c], mean[c]])))
            });
            Picture::new(first.width(), first.height(), pixels.collect()).expect("both have as many pixels")
        };
        Ok(Self {
            estimate: combined(|[a, b, mean]| 2.0 * mean - 0.5 * (a + b)),
            noise: combined(|[a, b, _]| 0.5 * (a - b)),
        })
    }
}

impl<P: Pixel> NoisyRender<P> {
    /// The estimates of both halves.
    pub fn halves(&self) -> Halves<'_, P> {
        Halves { a: &self.a.estimate, b: &self.b.estimate }
    }
}

/// A reference of two halves, encoded, free of the encoding's bias to first order.
///
/// The bias of a half is f(a) + f(b) - 2 f((a + b) / 2); it is taken off both halves alike. That leaves a bias of second
/// order in their product, which is small for a reference of many samples. Fails if sizes differ.
pub fn encoded_reference(
    halves: Halves<'_, LinearRgb>,
    encode: impl Fn(LinearRgb) -> SrgbRgb,
) -> Result<[Picture<SrgbRgb>; 2], MetricError> {
    check_size(size_of(halves.a), "reference's second half", size_of(halves.b))?;
    let half = |which: usize| {
        let pairs = halves.a.pixels().iter().zip(halves.b.pixels());
        let pixels = pairs.map(|(&a, &b)| {
            let [a, b, mean] = [a, b, mean_of(a, b)].map(|linear| encode(linear).0);
            SrgbRgb([0, 1, 2].map(|c| [a[c], b[c]][which] - (a[c] + b[c] - 2.0 * mean[c])))
        });
        Picture::new(halves.a.width(), halves.a.height(), pixels.collect()).expect("both have as many pixels")
    };
    Ok([half(0), half(1)])
}

fn mean_of(LinearRgb(a): LinearRgb, LinearRgb(b): LinearRgb) -> LinearRgb {
    LinearRgb([0, 1, 2].map(|c| 0.5 * (a[c] + b[c])))
}

#[cfg(test)]
mod tests {
    use mateval_testkit::synthetic_noise::{Render, SCATTERS, Scatter, mean_and_deviation, waves};

    use super::*;

    const SIDE: usize = 24;

    fn root(LinearRgb(rgb): LinearRgb) -> SrgbRgb {
        SrgbRgb(rgb.map(|v| v.max(0.0).sqrt()))
    }

    fn render(scatter: Scatter, samples: u32, seed: u64) -> Picture<LinearRgb> {
        Render { scatter, strength: 0.3, samples, blocks: None, view: 0 }.picture(&waves(SIDE), seed)
    }

    fn sum(picture: &Picture<SrgbRgb>) -> f64 {
        picture.pixels().iter().flat_map(|pixel| pixel.0).map(f64::from).sum::<f64>() / (3 * SIDE * SIDE) as f64
    }

    /// Computed by hand: quarters 0.25 and 0.81 under a root: 2 sqrt(0.53) - 0.7 and -0.2.
    #[test]
    fn a_half_by_hand() {
        let [first, second] = [0.25, 0.81].map(|v: f32| Picture::filled(1, 1, LinearRgb([v; 3])));
        let half = NoisyHalf::encoded([&first, &second], root).unwrap();
        assert!((half.estimate.get(0, 0).0[0] - (2.0 * 0.53_f32.sqrt() - 0.7)).abs() < 1e-6);
        assert!((half.noise.get(0, 0).0[2] + 0.2).abs() < 1e-6);
        let [a, b] = encoded_reference(Halves { a: &first, b: &second }, root).unwrap();
        let bias = 0.5 + 0.9 - 2.0 * 0.53_f32.sqrt();
        assert!((a.get(0, 0).0[0] - (0.5 - bias)).abs() < 1e-6 && (b.get(0, 0).0[0] - (0.9 - bias)).abs() < 1e-6);
        let wide = Picture::filled(2, 1, LinearRgb([0.0; 3]));
        assert!(matches!(NoisyHalf::encoded([&first, &wide], root), Err(MetricError::SizesDiffer { .. })));
        assert!(encoded_reference(Halves { a: &first, b: &wide }, root).is_err());
    }

    /// The mean over 100 seeds; the twin encodes the half itself. Both remain under 1 % of the standard deviation.
    #[test]
    fn the_bias_of_the_curve_is_gone() {
        for scatter in SCATTERS {
            let exact = sum(&waves(SIDE).map(root));
            let pairs: Vec<_> = (0..100).map(|seed| [2 * seed, 2 * seed + 1].map(|s| render(scatter, 16, s))).collect();
            let off = |of: &dyn Fn(&[Picture<LinearRgb>; 2]) -> Picture<SrgbRgb>| {
                mean_and_deviation(&pairs.iter().map(|pair| sum(&of(pair)) - exact).collect::<Vec<_>>()).0.abs()
            };
            let ours = off(&|[a, b]| NoisyHalf::encoded([a, b], root).unwrap().estimate);
            let reference = off(&|[a, b]| encoded_reference(Halves { a, b }, root).unwrap()[0].clone());
            let twin = off(&|[a, _]| a.map(root));
            assert!(ours < 0.25 * twin && reference < 0.25 * twin, "{scatter:?}: {ours} {reference} {twin}");
        }
    }
}
