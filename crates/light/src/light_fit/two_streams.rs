//! A fit and its noise, from two independent streams of samples.

use mateval_tracer::LightBasis;

use super::{FitTarget, LightFit, fit_lights};
use crate::error::LightError;
use crate::rules::FitRules;

/// The fits to two bases that come from independent samples.
#[derive(Clone, Debug, PartialEq)]
pub struct TwoStreamFit {
    /// One for each basis.
    pub streams: [LightFit; 2],
}

impl TwoStreamFit {
    /// The mean of both streams' weights, not negative.
    pub fn weights(&self) -> Vec<[f64; 3]> {
        self.combined(|a, b| 0.5 * (a + b))
    }

    /// Half the difference of the streams' weights: a draw from the mean's noise, of one degree of freedom. Its
    /// outer product with itself is an estimate of the covariance of the weights.
    pub fn spread(&self) -> Vec<[f64; 3]> {
        self.combined(|a, b| 0.5 * (a - b))
    }

    fn combined(&self, combine: fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
        let pairs = self.streams[0].weights.iter().zip(&self.streams[1].weights);
        pairs.map(|(a, b)| [0, 1, 2].map(|channel| combine(a[channel], b[channel]))).collect()
    }
}

/// Fits two bases of the same lights, which come from independent samples. Fails as [`fit_lights`] does.
pub fn fit_two_streams(
    rules: &FitRules,
    bases: [&LightBasis; 2],
    target: &FitTarget<'_>,
) -> Result<TwoStreamFit, LightError> {
    let groups = bases.map(|basis| basis.pictures().len());
    if groups[0] != groups[1] {
        return Err(LightError::StreamLights { groups });
    }
    Ok(TwoStreamFit { streams: [fit_lights(rules, bases[0], target)?, fit_lights(rules, bases[1], target)?] })
}
