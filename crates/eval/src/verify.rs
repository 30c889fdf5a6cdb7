//! Results checked: against themselves when they are read, and against the submission and dataset that they name.
//!
//! [`ResultFile::read`] recomputes every mean from the numbers below it. [`verify`] computes every number again: in
//! come a result, the submission and the dataset, out comes a [`VerificationFile`]. Before anything is rendered, hashes
//! and rules are compared: where they differ, numbers would too, and the findings state what has changed.

use std::path::Path;

use mateval_dataset::open::Dataset;
use mateval_dataset::{Finding, Progress, Severity, json};
use mateval_files::untrusted::sha256_of_file;
use mateval_submission::files::hashed_submission;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::EvalError;
use crate::metric::{LPIPS_NET, Metric};
use crate::protocol::Protocol;
use crate::result::key::ResultKey;
use crate::result::{MissingNumbers, RESULT_FORMAT, ResultFile, means, summary_noise};
use crate::score::{LpipsWeights, ScorePlan, score};

pub const VERIFICATION_FORMAT: &str = "mateval-verification/1";

/// Whether a result states what its submission scores.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VerificationFile {
    /// Always `mateval-verification/1`.
    pub format: String,
    /// Program and version, as in `mateval 0.1.0`.
    pub tool: String,
    /// SHA-256 of the result file, hex.
    pub result_sha256: String,
    /// The submission that the result names.
    pub submission_sha256: String,
    /// The dataset that the result names.
    pub dataset_manifest_sha256: String,
    /// Whether every number was reproduced: exactly, LPIPS to 1e-5.
    pub confirmed: bool,
    /// How many values of the result differ; 0 where none were computed again because hashes or rules differ.
    pub differences: usize,
    /// What differs: hashes and rules, or the first twenty values. Empty where `confirmed`.
    pub findings: Vec<Finding>,
}

pub struct VerifyPlan<'a> {
    pub result: &'a Path,
    /// The submission folder that it states.
    pub submission: &'a Path,
    /// The dataset that it was made on.
    pub dataset: &'a Dataset,
    /// The network of LPIPS; not needed where the result has no LPIPS.
    pub lpips: LpipsWeights,
    /// Name and version of this tool.
    pub tool: String,
    /// Number of scenes that are scored at once.
    pub jobs: usize,
}

/// The last part of a path, for findings.
fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// The most differences that are listed; all are counted.
const MOST_LISTED: usize = 20;

/// Verifies a result. Fails where that cannot be done: files that cannot be read, weights of LPIPS that are missing.
pub fn verify(plan: VerifyPlan<'_>, progress: Progress<'_>) -> Result<VerificationFile, EvalError> {
    let result = ResultFile::read(plan.result)?;
    let verification = VerificationFile {
        format: VERIFICATION_FORMAT.to_owned(),
        tool: plan.tool.clone(),
        result_sha256: sha256_of_file(plan.result)?,
        submission_sha256: result.submission.sha256.clone(),
        dataset_manifest_sha256: result.dataset.manifest_sha256.clone(),
        confirmed: false,
        differences: 0,
        findings: obstacles(&plan, &result)?,
    };
    if !verification.findings.is_empty() {
        return Ok(verification);
    }
    let name = file_name(plan.result);
    let mut again = scored_again(plan, &result, progress)?;
    // The verdict lies outside the dataset's identity and may have been made or changed since.
    again.tracer_check.clone_from(&result.tracer_check);
    let found = differences(&to_value(&result), &to_value(&again));
    let finding = |Difference { place, said, found }: &Difference| {
        let message = format!("the result states {said}, computed again it is {found}");
        let action = "the result was changed, or made by another version; score it again";
        Finding::new(Severity::Error, "differs", &name, place, message, action)
    };
    let findings = found.iter().take(MOST_LISTED).map(finding).collect();
    Ok(VerificationFile { confirmed: found.is_empty(), differences: found.len(), findings, ..verification })
}

fn scored_again(plan: VerifyPlan<'_>, result: &ResultFile, progress: Progress<'_>) -> Result<ResultFile, EvalError> {
    let protocols = result.protocols.keys().map(|name| Protocol::named(name)).collect::<Result<_, _>>()?;
    // A result without LPIPS is computed again without it.
    let without = MissingNumbers::Metric(Metric::LpipsAlex);
    let lpips = match result.missing.iter().find(|missing| missing.metric == without) {
        Some(missing) => LpipsWeights::Missing { reason: missing.reason.clone(), fix: missing.fix.clone() },
        None => plan.lpips,
    };
    // Versions are compared by the version of the rules.
    let again = ScorePlan::new(plan.dataset, vec![plan.submission], protocols, lpips, &result.tool);
    let plan = ScorePlan { scenes: result.dataset.scenes.clone(), jobs: plan.jobs, ..again };
    Ok(score(&plan, progress)?.remove(0))
}

fn to_value(value: impl Serialize) -> Value {
    serde_json::to_value(value).expect("our types can be written as JSON")
}

/// Everything that has changed; numbers are computed again only if this is empty. Fails if the result holds LPIPS and
/// its weights are missing.
fn obstacles(plan: &VerifyPlan<'_>, result: &ResultFile) -> Result<Vec<Finding>, EvalError> {
    let name = file_name(plan.result);
    let finding = |code: &str, place: &str, message: String, action: &str| {
        Finding::new(Severity::Error, code, &name, place, message, action)
    };
    let mut findings = Vec::new();
    for (name, scores) in &result.protocols {
        let place = format!("/protocols/{name}/protocol");
        let Ok(known) = Protocol::named(name) else {
            let message = format!("there is no protocol '{name}' in this version");
            findings.push(finding("other_protocol", &place, message, "verify it with the version that made it"));
            continue;
        };
        for difference in differences(&to_value(&scores.protocol), &to_value(&known)) {
            let message = format!("the result states {}; protocol '{name}' has {}", difference.said, difference.found);
            let place = format!("{place}{}", difference.place);
            findings.push(finding("other_protocol", &place, message, "score it again by the published rules"));
        }
    }
    let (said, found) = (&result.dataset.manifest_sha256, &plan.dataset.file.manifest_sha256);
    if said != found {
        let message = format!("made on a dataset with manifest {said}; this one's is {found}");
        let action = "verify it on the dataset that it was made on";
        findings.push(finding("other_dataset", "/dataset/manifest_sha256", message, action));
    } else {
        let submission = hashed_submission(plan.submission, plan.dataset, &result.dataset.scenes)?;
        if submission.sha256 != result.submission.sha256 {
            let message = format!(
                "made of a submission with hash {}; this one's is {} over submission.json and {} maps of the scored scenes",
                result.submission.sha256, submission.sha256, submission.maps
            );
            let action = "it is another submission, or one of its files has changed; score it again";
            findings.push(finding("other_submission", "/submission/sha256", message, action));
        }
    }
    if let Some(said) = result.lpips_weights.get(LPIPS_NET.name()).and_then(Option::as_ref) {
        match &plan.lpips {
            LpipsWeights::Missing { reason, fix } => {
                return Err(EvalError::LpipsWeights { reason: reason.clone(), fix: fix.clone() });
            }
            LpipsWeights::Loaded(lpips) if lpips.sha256() == said => {}
            LpipsWeights::Loaded(lpips) => {
                let message = format!("made with weights {said}; those here are {}", lpips.sha256());
                let action = "fetch the published weights: mateval fetch lpips";
                let place = format!("/lpips_weights/{}", LPIPS_NET.name());
                findings.push(finding("other_weights", &place, message, action));
            }
        }
    }
    findings.sort();
    Ok(findings)
}

impl ResultFile {
    /// Reads a result; fails where it has another format, is not valid, holds a number that this version does not know,
    /// or a mean that is not that of its own numbers.
    pub fn read(path: &Path) -> Result<Self, EvalError> {
        let result: Self = json::read_format(path, RESULT_FORMAT)?;
        match result.contradiction() {
            None => Ok(result),
            Some(Difference { place, said, found }) => {
                Err(EvalError::Contradiction { path: path.to_owned(), place, said, found })
            }
        }
    }

    /// The first mean that does not follow from the numbers below it: pictures to scenes, scenes to the summary.
    fn contradiction(&self) -> Option<Difference> {
        for (name, scores) in &self.protocols {
            let (scenes, summary) = means(&scores.pictures, &scores.texels);
            let noise = summary_noise(&scores.noise, &scenes);
            let said = to_value((&scores.scenes, &scores.summary, &scores.summary_noise));
            let found = to_value((&scenes, &summary, &noise));
            if let Some(first) = differences(&said, &found).into_iter().next() {
                let (at, rest) = first.place[1..].split_at(1);
                let part = ["scenes", "summary", "summary_noise"][at.parse::<usize>().unwrap_or(0)];
                return Some(Difference { place: format!("/protocols/{name}/{part}{rest}"), ..first });
            }
        }
        let deviations = self.constancy.iter().enumerate().flat_map(|(at, family)| {
            [("raw", &family.raw), ("aligned", &family.aligned)].map(|(name, deviation)| (at, name, deviation))
        });
        for (at, name, deviation) in deviations {
            let (said, found) = (to_value(deviation.relative), to_value(deviation.guarded()));
            if said != found {
                let place = format!("/constancy/{at}/{name}/relative");
                return Some(Difference { place, said: short(&said), found: short(&found) });
            }
        }
        None
    }
}

/// Two values at one place that are not the same.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Difference {
    place: String,
    said: String,
    found: String,
}

/// All differences, in the order of places. Numbers must be the same to the last bit, or within their metric's
/// tolerance.
fn differences(said: &Value, found: &Value) -> Vec<Difference> {
    let mut differences = Vec::new();
    compare(said, found, "", 0.0, &mut differences);
    differences
}

/// `place` is a JSON pointer.
fn compare(said: &Value, found: &Value, place: &str, tolerance: f64, differences: &mut Vec<Difference>) {
    let below = |key: &str| format!("{place}/{}", key.replace('~', "~0").replace('/', "~1"));
    match (said, found) {
        (Value::Object(a), Value::Object(b)) => {
            let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
            keys.sort();
            keys.dedup();
            for key in keys {
                // A mean by its key, or a picture's value by its metric.
                let metric = key.parse::<ResultKey>().map(|key| key.metric).or_else(|_| key.parse()).ok();
                let [a, b] = [a, b].map(|map| map.get(key).unwrap_or(&Value::Null));
                let tolerance = metric.map_or(0.0, Metric::tolerance);
                compare(a, b, &below(key), tolerance, differences);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (at, (a, b)) in a.iter().zip(b).enumerate() {
                compare(a, b, &below(&at.to_string()), 0.0, differences);
            }
        }
        _ if same(said, found, tolerance) => {}
        _ => differences.push(Difference { place: place.to_owned(), said: short(said), found: short(found) }),
    }
}

fn same(said: &Value, found: &Value, tolerance: f64) -> bool {
    match (said.as_f64(), found.as_f64()) {
        (Some(a), Some(b)) if tolerance > 0.0 => (a - b).abs() <= tolerance,
        _ => said == found,
    }
}

/// A value that fits in a line.
fn short(value: &Value) -> String {
    match value {
        Value::Array(list) => format!("a list of {}", list.len()),
        Value::Object(map) => format!("an object of {} members", map.len()),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn places(said: &Value, found: &Value) -> Vec<String> {
        differences(said, found).into_iter().map(|difference| difference.place).collect()
    }

    #[test]
    fn numbers_agree_to_the_last_bit() {
        let value = 0.1_f64;
        let next = f64::from_bits(value.to_bits() + 1);
        let said = json!({"summary": {"rgb_true.input.mse": value}, "list": [1, {"a/b": value}]});
        assert!(places(&said, &said).is_empty());
        let mut found = said.clone();
        found["summary"]["rgb_true.input.mse"] = next.into();
        found["list"][1]["a/b"] = next.into();
        assert_eq!(places(&said, &found), ["/list/1/a~1b", "/summary/rgb_true.input.mse"]);
    }

    #[test]
    fn lpips_agrees_to_five_decimals() {
        let value = |by: f64| {
            json!({
                "summary": {"albedo.input.lpips_alex": 0.25 + by},
                "pictures": [{"values": {"lpips_alex": 0.25 + by}}],
            })
        };
        assert!(places(&value(0.0), &value(9e-6)).is_empty());
        let both = ["/pictures/0/values/lpips_alex", "/summary/albedo.input.lpips_alex"];
        assert_eq!(places(&value(0.0), &value(1.1e-5)), both);
        // The twin: other metrics have no tolerance.
        let mse = |by: f64| json!({"pictures": [{"values": {"mse": 0.25 + by}}]});
        assert_eq!(places(&mse(0.0), &mse(1e-9)), ["/pictures/0/values/mse"]);
    }

    #[test]
    fn missing_values_and_other_types_differ() {
        let said = json!({"a": [1, 2], "b": "x", "c": 1});
        let found = json!({"a": [1], "b": 2, "d": 1});
        let found: Vec<[String; 3]> =
            differences(&said, &found).into_iter().map(|d| [d.place, d.said, d.found]).collect();
        let expected =
            [["/a", "a list of 2", "a list of 1"], ["/b", "\"x\"", "2"], ["/c", "1", "null"], ["/d", "null", "1"]];
        assert_eq!(found, expected.map(|row| row.map(str::to_owned)));
    }
}
