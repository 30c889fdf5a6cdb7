//! A fit and its noise, from two independent streams of samples.

use mateval_image::{LinearRgb, Picture};
use mateval_tracer::LightBasis;

use super::{FitTarget, LightFit, fit_lights};
use crate::error::LightError;
use crate::rules::FitRules;

/// Radiances fitted to all samples, and those fitted to each half of them.
#[derive(Clone, Debug, PartialEq)]
pub struct TwoStreamFit {
    /// The fit to the mean of both bases.
    pub joint: LightFit,
    /// The fit to each basis alone.
    pub streams: [LightFit; 2],
}

impl TwoStreamFit {
    /// Half the difference of the streams' weights: a draw from the joint weights' noise, of one degree of freedom. Its
    /// square is an estimate of their covariance, light by light and between lights.
    pub fn spread(&self) -> Vec<[f64; 3]> {
        let pairs = self.streams[0].weights.iter().zip(&self.streams[1].weights);
        pairs.map(|(a, b)| [0, 1, 2].map(|channel| (a[channel] - b[channel]) / 2.0)).collect()
    }

    /// The joint weights plus the spread, and less the spread. Half the difference of a number at these two, squared,
    /// estimates the variance that the noise of the basis causes in that number. Some weights may be negative.
    pub fn displaced(&self) -> [Vec<[f64; 3]>; 2] {
        let spread = self.spread();
        [1.0, -1.0].map(|sign| {
            let pairs = self.joint.weights.iter().zip(&spread);
            pairs.map(|(weight, spread)| [0, 1, 2].map(|channel| weight[channel] + sign * spread[channel])).collect()
        })
    }
}

/// Fits the mean of two bases, which come from independent samples, and each of them alone. Fails as [`fit_lights`] does.
pub fn fit_two_streams(
    rules: &FitRules,
    bases: [&LightBasis; 2],
    target: &FitTarget<'_>,
) -> Result<TwoStreamFit, LightError> {
    let streams = [fit_lights(rules, bases[0], target)?, fit_lights(rules, bases[1], target)?];
    let joint = fit_lights(rules, &mean(bases, target)?, target)?;
    Ok(TwoStreamFit { joint, streams })
}

/// The mean of two bases of the photo's size.
fn mean([a, b]: [&LightBasis; 2], target: &FitTarget<'_>) -> Result<LightBasis, LightError> {
    let groups = [a.pictures().len(), b.pictures().len()];
    if groups[0] != groups[1] {
        return Err(LightError::StreamLights { groups });
    }
    let (width, height) = (target.photo.width(), target.photo.height());
    let mean = |(a, b): (&Picture<LinearRgb>, &Picture<LinearRgb>)| {
        Picture::from_fn(width, height, |x, y| {
            let (a, b) = (a.get(x, y).0, b.get(x, y).0);
            LinearRgb([0, 1, 2].map(|channel| 0.5 * (a[channel] + b[channel])))
        })
    };
    let pictures = a.pictures().iter().zip(b.pictures()).map(mean).collect();
    Ok(LightBasis::new(width, height, pictures).expect("all pictures were made of one size"))
}
