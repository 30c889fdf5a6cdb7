//! Which encoding stored numbers fit, given the linear truth: a fit of log(prediction) against log(truth).
//!
//! Decoded by the right encoding, a prediction is the truth times a factor and an error. Its logarithm plotted against
//! the truth's is then a straight line of slope 1. Decoded by a wrong encoding, the line has another slope (0.45 for a
//! power of 1/2.2 that is read as linear) or is bent. Each group, a channel of a scene, has a free factor of its own.
//! The errors of a network repeat within an instance, so two encodings are compared over instances and not over pixels.
//!
//! A verdict is firm only if it could not as well come from the method's own errors. With many instances a difference
//! of a hundredth of an error is significant, and clipped highlights or contrast that is too low cause that much. So
//! the best encoding must explain at least [`LEAST_EXPLAINED`] of the truth's variance, and the error of every other
//! one must be at least [`CLEARLY_WORSE`] times as large.

use mateval_dataset::submission::StoredEncoding;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Smaller decoded numbers are replaced by this one, since 0 has no logarithm.
const LEAST_DECODED: f64 = 1e-4;
/// Larger decoded numbers, which a power can make infinite, are replaced by this one.
const LARGEST_DECODED: f64 = f32::MAX as f64;
/// An instance with fewer samples does not take part in the comparison of encodings.
const FEWEST_SAMPLES: usize = 8;
/// With fewer instances the verdict is [`Verdict::TooLittle`].
const FEWEST_INSTANCES: usize = 5;
/// If the standard deviation of the truth's logarithm within groups is smaller, the verdict is [`Verdict::TooLittle`].
const LEAST_SPREAD: f64 = 0.1;
/// If no encoding has at least this correlation, the verdict is [`Verdict::Unrelated`].
const LEAST_CORRELATION: f64 = 0.5;
/// Slopes below this one are taken for 0.
const LEAST_SLOPE: f64 = 1e-6;
/// An encoding is worse than another if its mean error is larger by more than this number of standard errors of the
/// difference, over the instances.
const STANDARD_ERRORS: f64 = 3.0;

/// If the best encoding explains a smaller share of the variance of the truth's logarithm, the verdict is
/// [`Verdict::Undecided`]. A power of 1/2.2 that is read as linear leaves (1 - 1/2.2)^2 = 0.30 unexplained by its slope
/// alone, so that beyond this the errors of the method are as large as those of a wrong encoding.
pub const LEAST_EXPLAINED: f64 = 0.7;
/// An encoding is worse than another only if its mean error is also at least this many times as large. A smaller
/// difference is less than half of the better one's error, so that an error of the method that follows the brightness,
/// such as low contrast, could reverse the order. sRGB and the power of 2.2, the closest encodings, differ by this much
/// if the method's own errors are below about 7 %.
pub const CLEARLY_WORSE: f64 = 1.5;

/// A stored number and the truth at its pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Natural logarithm of the linear truth.
    pub ln_truth: f64,
    /// The stored number, from 0 to 1 in most files.
    pub stored: f64,
    /// Index of the group whose factor is free.
    pub group: usize,
    pub instance: usize,
}

/// An encoding that numbers may fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FittedEncoding {
    /// Linear.
    Linear,
    /// IEC 61966-2-1.
    Srgb,
    /// A power of 2.2.
    Gamma22,
    /// A logarithm of any base and offset, which adapters cannot decode.
    Log,
}

/// How well one encoding explains the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Candidate {
    /// The encoding.
    pub encoding: FittedEncoding,
    /// Slope of the decoded number's logarithm against the truth's (of the number itself where the encoding is `log`).
    pub slope: f64,
    /// Correlation of both within groups.
    pub correlation: f64,
    /// Mean absolute difference of both logarithms, with a free factor for each group; for `log`, from its line.
    pub error: f64,
    /// Share of the variance of the truth's logarithm that is left without the squares of these differences, at most 1;
    /// below 0 if the differences vary more than the truth does.
    pub explained: f64,
}

/// What the numbers show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// They fit one encoding, and all others are worse.
    Fits,
    /// They fit several encodings, which they do not distinguish, or even the best explains little.
    Undecided,
    /// Too few instances or too little variation to decide.
    TooLittle,
    /// They do not follow the truth, whatever the encoding.
    Unrelated,
}

/// The result of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodingFit {
    pub verdict: Verdict,
    /// The encodings that they fit, the best first: all of them if even the best explains little; empty unless the
    /// verdict is `Fits` or `Undecided`.
    pub fits: Vec<FittedEncoding>,
    pub candidates: Vec<Candidate>,
    /// Number of instances with enough samples.
    pub instances: usize,
}

impl FittedEncoding {
    /// All encodings; `Log` is the last.
    const ALL: [Self; 4] = [Self::Linear, Self::Srgb, Self::Gamma22, Self::Log];

    /// The encoding as adapters state it; none for `Log`.
    pub fn stored(self) -> Option<StoredEncoding> {
        match self {
            Self::Linear => Some(StoredEncoding::Linear),
            Self::Srgb => Some(StoredEncoding::Srgb),
            Self::Gamma22 => Some(StoredEncoding::Gamma22),
            Self::Log => None,
        }
    }

    /// The word in reports.
    pub fn word(self) -> &'static str {
        self.stored().map_or("log", StoredEncoding::word)
    }

    /// The quantity that should depend linearly on the logarithm of the truth.
    fn ordinate(self, stored: f64) -> f64 {
        match self.stored() {
            Some(encoding) => {
                let decoded = f64::from(encoding.decode(stored as f32));
                libm::log(decoded.clamp(LEAST_DECODED, LARGEST_DECODED))
            }
            None => stored,
        }
    }
}

/// Finds the encoding that the samples fit.
pub fn fit(samples: &[Sample]) -> EncodingFit {
    let instances = counted_instances(samples);
    let count = instances.iter().filter(|is_counted| **is_counted).count();
    let x = centred(samples, |sample| sample.ln_truth);
    let lines = FittedEncoding::ALL.map(|encoding| Line::new(encoding, samples, &x));
    let candidates: Vec<Candidate> = lines.iter().map(|line| line.candidate).collect();
    let spread = (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let result = |verdict, fits| EncodingFit { verdict, fits, candidates: candidates.clone(), instances: count };
    if count < FEWEST_INSTANCES || spread < LEAST_SPREAD {
        return result(Verdict::TooLittle, Vec::new());
    }
    if candidates.iter().all(|candidate| candidate.correlation < LEAST_CORRELATION) {
        return result(Verdict::Unrelated, Vec::new());
    }
    let mut fits = not_worse(&lines, samples, &instances);
    if best_explained(&candidates) < LEAST_EXPLAINED {
        let mut rest: Vec<&Candidate> = candidates.iter().filter(|other| !fits.contains(&other.encoding)).collect();
        rest.sort_by(|a, b| a.error.total_cmp(&b.error));
        fits.extend(rest.into_iter().map(|candidate| candidate.encoding));
    }
    result(if fits.len() == 1 { Verdict::Fits } else { Verdict::Undecided }, fits)
}

/// The largest share of the truth's variance that one of the encodings explains.
pub fn best_explained(candidates: &[Candidate]) -> f64 {
    candidates.iter().map(|candidate| candidate.explained).fold(f64::NEG_INFINITY, f64::max)
}

/// The line of an encoding, and how far each sample lies from it.
struct Line {
    candidate: Candidate,
    /// Distances from the line of slope 1; for `log`, from the fitted line.
    deviations: Vec<f64>,
    /// Distances from the fitted line divided by its slope: they measure the bend and not the slope.
    bends: Vec<f64>,
}

impl Line {
    fn new(encoding: FittedEncoding, samples: &[Sample], x: &[f64]) -> Self {
        let y = centred(samples, |sample| encoding.ordinate(sample.stored));
        let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (xx, xy, yy) = (sum(x, x), sum(x, &y), sum(&y, &y));
        let slope = if xx > 0.0 { xy / xx } else { 0.0 };
        let correlation = if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 };
        // A slope of 0 or below explains nothing, however small the deviations are: numbers that decoding clips to one
        // value, such as negative logarithms, leave all that the truth varies.
        let unit = slope.max(LEAST_SLOPE);
        let bend = |(y, x): (&f64, &f64)| {
            let bend = ((y - slope * x) / unit).abs();
            if slope > LEAST_SLOPE { bend } else { bend.max(x.abs()) }
        };
        let bends: Vec<f64> = y.iter().zip(x).map(bend).collect();
        let deviations = match encoding {
            FittedEncoding::Log => bends.clone(),
            _ => y.iter().zip(x).map(|(y, x)| (y - x).abs()).collect(),
        };
        let error = deviations.iter().sum::<f64>() / deviations.len().max(1) as f64;
        let explained = if xx > 0.0 { 1.0 - sum(&deviations, &deviations) / xx } else { 0.0 };
        Self { candidate: Candidate { encoding, slope, correlation, error, explained }, deviations, bends }
    }

    /// The sum of the bends.
    fn bend(&self) -> f64 {
        self.bends.iter().sum()
    }
}

/// The encodings that are not worse than the best, the best first. The slope of `log` is free, so only bends decide
/// between it and the others. `lines` are those of [`FittedEncoding::ALL`].
fn not_worse(lines: &[Line; 4], samples: &[Sample], instances: &[bool]) -> Vec<FittedEncoding> {
    let [first, second, third, log] = lines;
    let mut powers = [first, second, third];
    let is_worse = |a: &[f64], b: &[f64]| is_larger(a, b, samples, instances);
    // Between the logarithm and the others.
    powers.sort_by(|a, b| a.bend().total_cmp(&b.bend()));
    let straightest = powers[0];
    let powers_fit = !is_worse(&straightest.bends, &log.bends);
    let log_fits = !is_worse(&log.bends, &straightest.bends);
    // Among the others.
    powers.sort_by(|a, b| a.candidate.error.total_cmp(&b.candidate.error));
    let best = powers[0];
    let kept = powers.iter().filter(|line| powers_fit && !is_worse(&line.deviations, &best.deviations));
    let mut fits: Vec<FittedEncoding> = kept.map(|line| line.candidate.encoding).collect();
    if log_fits {
        let place = if log.bend() < straightest.bend() { 0 } else { fits.len() };
        fits.insert(place, log.candidate.encoding);
    }
    fits
}

/// Whether the first deviations are clearly larger than the second ones, and by more than chance, over the instances
/// with enough samples.
fn is_larger(first: &[f64], second: &[f64], samples: &[Sample], instances: &[bool]) -> bool {
    if first.iter().sum::<f64>() < CLEARLY_WORSE * second.iter().sum::<f64>() {
        return false;
    }
    let mut sums = vec![(0.0, 0_usize); instances.len()];
    for (sample, (a, b)) in samples.iter().zip(first.iter().zip(second)) {
        let (sum, count) = &mut sums[sample.instance];
        *sum += a - b;
        *count += 1;
    }
    let counted = sums.into_iter().zip(instances).filter(|(_, is_counted)| **is_counted);
    let means: Vec<f64> = counted.map(|((sum, count), _)| sum / count as f64).collect();
    let count = means.len() as f64;
    let mean = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (count - 1.0);
    mean > STANDARD_ERRORS * (variance / count).sqrt() && mean > 0.0
}

/// Whether each instance has enough samples.
fn counted_instances(samples: &[Sample]) -> Vec<bool> {
    let mut counts = vec![0; samples.iter().map(|sample| sample.instance + 1).max().unwrap_or(0)];
    for sample in samples {
        counts[sample.instance] += 1;
    }
    counts.into_iter().map(|count| count >= FEWEST_SAMPLES).collect()
}

/// The values of all samples, less the mean of their group.
fn centred(samples: &[Sample], value: impl Fn(&Sample) -> f64) -> Vec<f64> {
    let mut sums = vec![(0.0, 0_usize); samples.iter().map(|sample| sample.group + 1).max().unwrap_or(0)];
    let values: Vec<f64> = samples.iter().map(&value).collect();
    for (sample, value) in samples.iter().zip(&values) {
        sums[sample.group].0 += value;
        sums[sample.group].1 += 1;
    }
    let mean = |group: usize| sums[group].0 / sums[group].1 as f64;
    samples.iter().zip(&values).map(|(sample, value)| value - mean(sample.group)).collect()
}

#[cfg(test)]
mod tests {
    use mateval_dataset::splitmix64::number;
    use mateval_image::transfer::srgb_from_linear;

    use super::*;

    /// 20 instances with albedos from 0.02 to 0.9, whose stored numbers are `encode` of the truth times 0.8 and an
    /// error: a factor with this standard deviation of its logarithm, partly shared by an instance's samples.
    fn samples(noise: f64, encode: impl Fn(f64) -> f64) -> Vec<Sample> {
        let mut index = 0;
        let mut uniform = || {
            index += 1;
            (number(7, index) >> 11) as f64 / (1_u64 << 53) as f64
        };
        // A sum of twelve numbers from 0 to 1 has the variance 1.
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let mut all = Vec::new();
        for instance in 0..20 {
            let base = libm::log(0.03) + libm::log(25.0) * f64::from(instance as u32) / 19.0;
            let shared = normal();
            for _ in 0..30 {
                let ln_truth = base + 0.2 * normal();
                let error = noise * (0.8 * shared + 0.6 * normal());
                let stored = encode(0.8 * libm::exp(ln_truth + error));
                all.push(Sample { ln_truth, stored, group: instance % 3, instance });
            }
        }
        all
    }

    fn srgb(linear: f64) -> f64 {
        f64::from(srgb_from_linear(linear as f32))
    }

    fn power(linear: f64) -> f64 {
        libm::pow(linear, 1.0 / 2.2)
    }

    fn log(linear: f64) -> f64 {
        (libm::log(linear) + 5.0) / 5.0
    }

    #[test]
    fn each_encoding_is_found() {
        type Encode = fn(f64) -> f64;
        let cases: [(FittedEncoding, Encode); 4] = [
            (FittedEncoding::Linear, |linear| linear),
            (FittedEncoding::Srgb, srgb),
            (FittedEncoding::Gamma22, power),
            (FittedEncoding::Log, log),
        ];
        for (encoding, encode) in cases {
            for noise in [0.0, 0.01] {
                let bytes = samples(noise, |linear| (255.0 * encode(linear)).round() / 255.0);
                let found = fit(&bytes);
                assert_eq!((found.verdict, found.fits), (Verdict::Fits, vec![encoding]), "{:?}", found.candidates);
            }
        }
    }

    /// Every other encoding clips negative numbers to one value.
    #[test]
    fn negative_logarithms_are_found() {
        let found = fit(&samples(0.01, |linear| libm::log(linear + 0.001).min(-1e-3)));
        assert_eq!((found.verdict, found.fits), (Verdict::Fits, vec![FittedEncoding::Log]), "{:?}", found.candidates);
    }

    /// The slope of a power of 1/2.2 that is read as linear is 1/2.2.
    #[test]
    fn slopes_are_those_of_the_encodings() {
        let found = fit(&samples(0.0, power));
        assert!((found.candidates[0].slope - 1.0 / 2.2).abs() < 1e-6 && (found.candidates[2].slope - 1.0).abs() < 1e-6);
        assert!(found.candidates[2].error < 1e-6 && found.candidates[0].error > 0.1);
    }

    /// sRGB and the power 1/2.2 differ by a few per cent: under the errors of a network they cannot be distinguished,
    /// but linear numbers can.
    #[test]
    fn encodings_that_cannot_be_distinguished_are_all_named() {
        let found = fit(&samples(0.4, power));
        assert_eq!(found.verdict, Verdict::Undecided);
        assert!(found.fits.contains(&FittedEncoding::Gamma22) && found.fits.contains(&FittedEncoding::Srgb));
        assert!(!found.fits.contains(&FittedEncoding::Linear), "{found:?}");
    }

    /// Decoded by a power, 1e30 is infinite in single precision.
    #[test]
    fn huge_numbers_leave_the_report_finite() {
        let mut all = samples(0.0, power);
        all[0].stored = 1e30;
        for candidate in fit(&all).candidates {
            assert!([candidate.slope, candidate.correlation, candidate.error].into_iter().all(f64::is_finite));
        }
    }

    /// The errors of a network are as large as the differences between encodings: with many instances one encoding is
    /// still significantly better than the others, but it explains little, or hardly more than the second.
    #[test]
    fn noisy_numbers_decide_nothing() {
        let noise = |noise: f64| {
            let mut many = samples(noise, log);
            for copy in 1..50 {
                many.extend(samples(noise, log).into_iter().map(|s| Sample { instance: s.instance + 20 * copy, ..s }));
            }
            many
        };
        for (of, explains_enough) in [(0.4, true), (0.7, false), (1.2, false)] {
            let found = fit(&noise(of));
            assert_eq!(found.verdict, Verdict::Undecided, "{of}: {found:?}");
            assert_eq!(best_explained(&found.candidates) >= LEAST_EXPLAINED, explains_enough, "{of}: {found:?}");
            assert!(found.fits.len() >= 2 && found.fits.contains(&FittedEncoding::Log), "{of}: {found:?}");
        }
        // The twin: with small errors the same many instances decide.
        assert_eq!(fit(&noise(0.1)).verdict, Verdict::Fits);
    }

    #[test]
    fn too_little_and_unrelated_numbers_decide_nothing() {
        let few: Vec<Sample> = samples(0.0, power).into_iter().filter(|sample| sample.instance < 4).collect();
        assert_eq!(fit(&few).verdict, Verdict::TooLittle);
        assert_eq!(fit(&[]).verdict, Verdict::TooLittle);
        assert_eq!(fit(&samples(0.0, |_| 0.5)).verdict, Verdict::Unrelated);
        assert_eq!(fit(&samples(0.0, |linear| 1.0 - linear)).verdict, Verdict::Unrelated);
        let same: Vec<Sample> = samples(0.0, power).into_iter().map(|s| Sample { ln_truth: -1.0, ..s }).collect();
        assert_eq!(fit(&same).verdict, Verdict::TooLittle);
    }
}
