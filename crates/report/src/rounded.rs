//! The result of a hidden split that its keeper may show: headline numbers, rounded.
//!
//! A whole result states the error of every instance, so that a few constant submissions solve for its mean colour. The
//! rounded one has no scene, instance or picture, and no digit that is finer than the number's own error.

use std::collections::BTreeMap;

use mateval_dataset::dataset::DatasetVersion;
use mateval_eval::metric::Metric;
use mateval_eval::result::key::ResultKey;
use mateval_eval::result::{ProtocolResult, ResultFile};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::titles::shown_method;

pub const ROUNDED_FORMAT: &str = "mateval-rounded/1";

/// A rounded result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoundedFile {
    /// Always `mateval-rounded/1`.
    pub format: String,
    /// Program and version, as in `mateval 0.1.0`.
    pub tool: String,
    /// The method's name.
    pub method: String,
    /// SHA-256, hex, of the submission, as in the whole result.
    pub submission_sha256: String,
    /// The dataset.
    pub dataset: DatasetVersion,
    /// Number of scored scenes.
    pub scenes: usize,
    /// Number of houses that they belong to.
    pub houses: usize,
    /// Maps that the submission never holds.
    pub not_predicted: Vec<String>,
    /// Number of findings about the submission; `eval lint` lists them.
    pub findings: usize,
    /// By protocol, its headline numbers: PSNR as a multiple of 0.1 dB or of its standard error, whichever is larger;
    /// others as a multiple of 0.01.
    pub headline: BTreeMap<String, BTreeMap<ResultKey, f64>>,
}

impl RoundedFile {
    pub fn new(result: &ResultFile) -> Self {
        let houses: std::collections::BTreeSet<&String> = result.dataset.houses.values().collect();
        Self {
            format: ROUNDED_FORMAT.to_owned(),
            tool: result.tool.clone(),
            method: shown_method(result),
            submission_sha256: result.submission.sha256.clone(),
            dataset: result.dataset.named(),
            scenes: result.dataset.scenes.len(),
            houses: houses.len(),
            not_predicted: result.not_predicted.clone(),
            findings: result.findings.len(),
            headline: result.protocols.iter().map(|(name, scores)| (name.clone(), headline(scores))).collect(),
        }
    }
}

fn headline(scores: &ProtocolResult) -> BTreeMap<ResultKey, f64> {
    let number =
        |key: &ResultKey| Some((*key, rounded(*key, *scores.summary.get(key)?, scores.summary_noise.get(key))));
    scores.protocol.headline.iter().filter_map(number).collect()
}

fn rounded(key: ResultKey, value: f64, error: Option<&f64>) -> f64 {
    // In hundredths, so that the step itself has no further digits.
    let least: f64 = if key.metric == Metric::Psnr { 10.0 } else { 1.0 };
    let step = error.map_or(least, |error| least.max((error * 100.0).ceil()));
    (value * 100.0 / step).round() * step / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_digit_is_finer_than_the_error() {
        let key = |text: &str| text.parse::<ResultKey>().unwrap();
        let psnr = key("rgb_true.novel.psnr");
        assert_eq!(rounded(psnr, 21.2734, None), 21.3);
        assert_eq!(rounded(psnr, 21.2734, Some(&0.02)), 21.3);
        assert_eq!(rounded(psnr, 21.2734, Some(&0.2512)), 21.32);
        assert_eq!(rounded(key("albedo.novel.lpips_alex"), 0.123_456, None), 0.12);
    }
}
