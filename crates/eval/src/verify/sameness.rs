//! Whether a result can be computed again: same format, rules, dataset, submission and network.

use mateval_scene::{Finding, Severity};

use super::differences::differences;
use super::plan::{VerifyPlan, file_name};
use crate::error::EvalError;
use crate::metric::LPIPS_NET;
use crate::protocol::Protocol;
use crate::result::ResultFile;
use crate::score::LpipsWeights;
use mateval_submission::hashed_submission::hashed_submission;

/// Everything that has changed; numbers are computed again only if this is empty. Fails if the result holds LPIPS and its
/// weights are missing.
pub(super) fn findings(plan: &VerifyPlan<'_>, result: &ResultFile) -> Result<Vec<Finding>, EvalError> {
    let name = file_name(plan.result);
    let finding = |code: &str, place: &str, message: String, action: &str| Finding {
        severity: Severity::Error,
        code: code.to_owned(),
        file: name.clone(),
        place: place.to_owned(),
        message,
        action: action.to_owned(),
    };
    let mut findings = Vec::new();
    findings.extend(rules(result, &finding)?);
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
    findings.extend(weights(plan, result, &finding)?);
    findings.sort();
    Ok(findings)
}

type MakeFinding<'a> = dyn Fn(&str, &str, String, &str) -> Finding + 'a;

fn rules(result: &ResultFile, finding: &MakeFinding<'_>) -> Result<Vec<Finding>, EvalError> {
    let mut findings = Vec::new();
    for (name, scores) in &result.protocols {
        let place = format!("/protocols/{name}/protocol");
        let Ok(known) = Protocol::named(name) else {
            let message = format!("there is no protocol '{name}' in this version");
            findings.push(finding("other_protocol", &place, message, "verify it with the version that made it"));
            continue;
        };
        let values =
            [&scores.protocol, &known].map(|protocol| serde_json::to_value(protocol).map_err(EvalError::Compare));
        let [said, known] = values;
        for difference in differences(&said?, &known?) {
            let message = format!("the result states {}; protocol '{name}' has {}", difference.said, difference.found);
            let place = format!("{place}{}", difference.place);
            findings.push(finding("other_protocol", &place, message, "score it again by the published rules"));
        }
    }
    Ok(findings)
}

fn weights(
    plan: &VerifyPlan<'_>,
    result: &ResultFile,
    finding: &MakeFinding<'_>,
) -> Result<Option<Finding>, EvalError> {
    let Some(said) = result.lpips_weights.get(LPIPS_NET.name()).and_then(Option::as_ref) else { return Ok(None) };
    match &plan.lpips {
        LpipsWeights::Missing { reason, fix } => {
            Err(EvalError::LpipsWeights { reason: reason.clone(), fix: fix.clone() })
        }
        LpipsWeights::Loaded(lpips) if lpips.sha256() == said => Ok(None),
        LpipsWeights::Loaded(lpips) => {
            let message = format!("made with weights {said}; those here are {}", lpips.sha256());
            let action = "fetch the published weights: mateval fetch lpips";
            Ok(Some(finding("other_weights", "/lpips_weights/alex", message, action)))
        }
    }
}
