//! Verification of a result: every number is computed again from the same dataset and submission.
//!
//! In: a result file, the submission and the dataset that it names. Out: a [`VerificationFile`]. Before anything is
//! rendered, hashes and rules are compared: where they differ, numbers would too, and the findings state what has changed.

mod differences;
pub mod file;
mod plan;
mod sameness;

use mateval_scene::manifest::sha256_of_file;
use mateval_scene::{Finding, Progress, Severity};

use crate::error::EvalError;
use crate::metric::Metric;
use crate::protocol::Protocol;
use crate::result::{MissingNumbers, ResultFile};
use crate::score::{LpipsWeights, ScorePlan, score};
use differences::{Difference, differences};
pub use file::{VERIFICATION_FORMAT, VerificationFile};
pub use plan::VerifyPlan;
use plan::file_name;

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
        findings: sameness::findings(&plan, &result)?,
    };
    if !verification.findings.is_empty() {
        return Ok(verification);
    }
    let name = file_name(plan.result);
    let again = scored_again(plan, &result, progress)?;
    let found = differences(&to_value(&result)?, &to_value(&again)?);
    let findings = found.iter().take(MOST_LISTED).map(|difference| finding(&name, difference)).collect();
    Ok(VerificationFile { confirmed: found.is_empty(), differences: found.len(), findings, ..verification })
}

fn scored_again(plan: VerifyPlan<'_>, result: &ResultFile, progress: Progress<'_>) -> Result<ResultFile, EvalError> {
    let protocols = result.protocols.keys().map(|name| Protocol::named(name)).collect::<Result<_, _>>()?;
    let plan = ScorePlan {
        dataset: plan.dataset,
        submissions: vec![plan.submission],
        protocols,
        scenes: result.dataset.scenes.clone(),
        lpips: as_in_the_result(plan.lpips, result),
        // Versions are compared by the version of the rules.
        tool: result.tool.clone(),
        jobs: plan.jobs,
        cache: None,
        only_cached: false,
        companion_cache: plan.companion_cache,
    };
    Ok(score(&plan, progress)?.remove(0))
}

/// A result without LPIPS is computed again without it.
fn as_in_the_result(lpips: LpipsWeights, result: &ResultFile) -> LpipsWeights {
    match result.missing.iter().find(|missing| missing.metric == MissingNumbers::Metric(Metric::LpipsAlex)) {
        Some(missing) => LpipsWeights::Missing { reason: missing.reason.clone(), fix: missing.fix.clone() },
        None => lpips,
    }
}

fn to_value(result: &ResultFile) -> Result<serde_json::Value, EvalError> {
    serde_json::to_value(result).map_err(EvalError::Compare)
}

fn finding(file: &str, difference: &Difference) -> Finding {
    Finding {
        severity: Severity::Error,
        code: "differs".to_owned(),
        file: file.to_owned(),
        place: difference.place.clone(),
        message: format!("the result states {}, computed again it is {}", difference.said, difference.found),
        action: "the result was changed, or made by another version; score it again".to_owned(),
    }
}
