//! The result of a hidden split that its keeper may show: headline numbers, rounded, and none that is not better than
//! what everybody reaches.
//!
//! A whole result states the error of every instance, so that a few constant submissions solve for its mean colour. The
//! rounded one has no scene, instance or picture, and no digit that is finer than the number's own error. Rounded means
//! over a split still solve for one colour, that of all its rooms: so a number is stated only where it is better than that
//! of the floors, results of baselines that anybody can make from the public files. This is the Ladder mechanism (Blum and
//! Hardt, ICML 2015) from a public start: the numbers shown do not distinguish submissions below it, such as constants.

use std::collections::BTreeMap;

use mateval_dataset::SceneId;
use mateval_dataset::dataset::DatasetVersion;
use mateval_dataset::open::Dataset;
use mateval_eval::metric::Metric;
use mateval_eval::result::key::ResultKey;
use mateval_eval::result::{ProtocolResult, ResultFile};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Mismatch, ReportError};

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
    /// The methods whose results are the floor, in the order in which they were given.
    pub floors: Vec<String>,
    /// By protocol, its headline numbers: PSNR as a multiple of 0.1 dB or of its standard error, whichever is larger;
    /// others as a multiple of 0.01. Numbers that no floor has are left out.
    pub headline: BTreeMap<String, BTreeMap<ResultKey, f64>>,
    /// By protocol, the headline numbers that are not better than the floor's; `headline` has the floor's in their place.
    pub at_floor: BTreeMap<String, Vec<ResultKey>>,
}

impl RoundedFile {
    /// The rounded form of a result. Fails where a floor is not about the same dataset, rules, weights and scenes.
    pub fn new(result: &ResultFile, floors: &[ResultFile]) -> Result<Self, ReportError> {
        let houses: std::collections::BTreeSet<&String> = result.dataset.houses.values().collect();
        ReportError::refuse(floors.iter().filter_map(|floor| unfit(result, floor)).collect())?;
        let (mut headline, mut at_floor) = (BTreeMap::new(), BTreeMap::new());
        for (name, scores) in &result.protocols {
            let floors: Vec<&ProtocolResult> = floors.iter().filter_map(|floor| floor.protocols.get(name)).collect();
            let (shown, below) = shown(scores, &floors);
            headline.insert(name.clone(), shown);
            at_floor.insert(name.clone(), below);
        }
        Ok(Self {
            format: ROUNDED_FORMAT.to_owned(),
            tool: result.tool.clone(),
            method: result.shown_method(),
            submission_sha256: result.submission.sha256.clone(),
            dataset: result.dataset.named(),
            scenes: result.dataset.scenes.len(),
            houses: houses.len(),
            not_predicted: result.not_predicted.clone(),
            findings: result.findings.len(),
            floors: floors.iter().map(ResultFile::shown_method).collect(),
            headline,
            at_floor,
        })
    }
}

/// Fails where a floor was not scored on the dataset, or lacks one of the scenes that are to be scored.
pub fn check_floor<'a>(
    floor: &ResultFile,
    dataset: &Dataset,
    scenes: impl IntoIterator<Item = &'a SceneId>,
) -> Result<(), ReportError> {
    let method = floor.shown_method();
    let missing: Vec<&SceneId> = scenes.into_iter().filter(|id| !floor.dataset.scenes.contains(id)).collect();
    let lacks = |first: &&SceneId| Mismatch::FloorScenes { method, missing: missing.len(), first: (*first).clone() };
    let mismatch = Mismatch::of_dataset(floor, dataset).or_else(|| missing.first().map(lacks));
    ReportError::refuse(mismatch.into_iter().collect())
}

/// Why the numbers of a floor cannot be compared with those of a result. A floor may cover more scenes: those of the
/// result are taken.
fn unfit(result: &ResultFile, floor: &ResultFile) -> Option<Mismatch> {
    let (first, other) = (floor.shown_method(), result.shown_method());
    let is_alike = |(name, scores): (&String, &ProtocolResult)| {
        floor.protocols.get(name).is_some_and(|of_floor| of_floor.protocol == scores.protocol)
    };
    let same_data = floor.dataset.manifest_sha256 == result.dataset.manifest_sha256;
    if !same_data || floor.lpips_weights != result.lpips_weights || !result.protocols.iter().all(is_alike) {
        return Some(Mismatch::Fingerprints { first, other });
    }
    let covers = result.dataset.scenes.iter().all(|scene| floor.dataset.scenes.contains(scene));
    (!covers).then_some(Mismatch::Scenes { first, other })
}

/// The headline numbers that may be shown, and the keys of those that are the floor's.
fn shown(scores: &ProtocolResult, floors: &[&ProtocolResult]) -> (BTreeMap<ResultKey, f64>, Vec<ResultKey>) {
    let (mut numbers, mut at_floor) = (BTreeMap::new(), Vec::new());
    for key in &scores.protocol.headline {
        let error = scores.summary_noise.get(key);
        let sign = key.metric.better().sign();
        let of_floors = floors.iter().filter_map(|floor| mean(floor, scores.scenes.keys(), key));
        let best = of_floors.map(|value| rounded(*key, value, error)).max_by(|a, b| (sign * a).total_cmp(&(sign * b)));
        let (Some(floor), Some(value)) = (best, scores.summary.get(key)) else { continue };
        let own = rounded(*key, *value, error);
        let is_better = sign * own > sign * floor;
        numbers.insert(*key, if is_better { own } else { floor });
        at_floor.extend((!is_better).then_some(*key));
    }
    (numbers, at_floor)
}

/// The mean of a number over those of the scenes that have it.
fn mean<'a>(floor: &ProtocolResult, scenes: impl Iterator<Item = &'a SceneId>, key: &ResultKey) -> Option<f64> {
    let values: Vec<f64> = scenes.filter_map(|scene| floor.scenes.get(scene)?.get(key).copied()).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
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

    use crate::ranking::tests::{result, scores};

    /// A number above the floor is stated; every number below it looks like every other.
    #[test]
    fn what_is_not_above_the_floor_is_not_told_apart() {
        let floors = [result("floor", &scores(20.0, 0.1)), result("lower", &scores(5.0, 0.1))];
        let shown = |psnr: f64| {
            let file = RoundedFile::new(&result("a", &scores(psnr, 0.1)), &floors).unwrap();
            (file.headline["mateval-3"].clone(), file.at_floor["mateval-3"].clone())
        };
        let keys = shown(3.0).1;
        assert!(!keys.is_empty());
        assert_eq!([shown(3.0), shown(8.0)], [shown(20.0), shown(20.0)]);
        let (numbers, at_floor) = shown(20.5);
        assert_eq!(at_floor, []);
        assert!(keys.iter().all(|key| (numbers[key] - shown(3.0).0[key] - 0.5).abs() < 1e-9), "{numbers:?}");
        assert_eq!(RoundedFile::new(&result("a", &scores(9.0, 0.1)), &[]).unwrap().headline["mateval-3"].len(), 0);
    }

    #[test]
    fn floors_are_results_of_the_same_scenes() {
        let (own, floor) = (result("own", &scores(20.0, 0.1)), result("floor", &scores(10.0, 0.1)));
        let refused = |change: fn(&mut ResultFile)| {
            let mut floor = floor.clone();
            change(&mut floor);
            RoundedFile::new(&own, &[floor]).unwrap_err().to_string()
        };
        assert!(refused(|floor| floor.dataset.manifest_sha256 = "0".repeat(64)).contains("different fingerprints"));
        assert!(refused(|floor| floor.protocols.clear()).contains("different fingerprints"));
        assert!(refused(|floor| floor.dataset.scenes.truncate(1)).contains("different scenes"));
        // More scenes than the result's are no fault: those of the result are taken.
        let mut part = result("part", &scores(20.0, 0.1)[..2]);
        part.dataset.manifest_sha256.clone_from(&floor.dataset.manifest_sha256);
        assert!(RoundedFile::new(&part, &[floor]).is_ok());
    }
}
