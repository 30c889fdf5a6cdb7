//! Whether a result, a dataset and a submission belong together.

use super::file::{AlignedBy, ExplainFile};
use super::plan::ExplainPlan;
use crate::error::ReportError;
use crate::mismatch::{DatasetVersion, Mismatch, SubmissionVersion};
use mateval_eval::metric::Metric;
use mateval_eval::protocol::SCORER_VERSION;
use mateval_eval::result::ProtocolResult;
use mateval_eval::result_key::{PictureKind, ResultKey};
use mateval_submission::hashed_submission::{HashedSubmission, hashed_submission};

/// The scores to explain. Fails with every reason for which the three do not belong together.
pub(super) fn check<'a>(plan: &ExplainPlan<'a>) -> Result<&'a ProtocolResult, ReportError> {
    let (result, dataset) = (plan.result, plan.dataset);
    let scores = plan.scores()?;
    let mut mismatches = Vec::new();
    if scores.protocol.scorer_version != SCORER_VERSION {
        mismatches.push(Mismatch::Scorer { found: scores.protocol.scorer_version });
    }
    if result.dataset.manifest_sha256 != dataset.file.manifest_sha256 {
        mismatches.push(other_dataset(plan));
    }
    if !result.dataset.scenes.contains(plan.scene) {
        let scored = result.dataset.scenes.clone();
        mismatches.push(Mismatch::SceneNotScored { scene: plan.scene.clone(), scored });
    }
    if mismatches.is_empty() {
        mismatches.extend(other_submission(plan)?);
    }
    ReportError::refuse(mismatches).map(|()| scores)
}

fn other_dataset(plan: &ExplainPlan<'_>) -> Mismatch {
    let (expected, found) = (&plan.result.dataset, &plan.dataset.file);
    Mismatch::Dataset {
        expected: DatasetVersion {
            name: expected.name.clone(),
            version: expected.version.clone(),
            manifest_sha256: expected.manifest_sha256.clone(),
        },
        path: plan.dataset.root.clone(),
        found: DatasetVersion {
            name: found.name.clone(),
            version: found.version.clone(),
            manifest_sha256: found.manifest_sha256.clone(),
        },
    }
}

/// A mismatch if the submission does not have the hash that the result states.
fn other_submission(plan: &ExplainPlan<'_>) -> Result<Option<Mismatch>, ReportError> {
    let result = plan.result;
    let HashedSubmission { method, sha256, maps } =
        hashed_submission(plan.submission, plan.dataset, &result.dataset.scenes)?;
    let expected = SubmissionVersion { method: result.method.clone(), sha256: result.submission.sha256.clone() };
    Ok((sha256 != expected.sha256).then(|| Mismatch::Submission {
        expected,
        path: plan.submission.to_owned(),
        found: SubmissionVersion { method, sha256 },
        maps,
    }))
}

/// Fails if scores of the pictures made here differ from the result's: the explanation would be of something else.
pub(super) fn check_scores(scores: &ProtocolResult, file: &ExplainFile) -> Result<(), ReportError> {
    let of_scene = scores.scenes.get(&file.scene);
    let pictures = [(AlignedBy::None, PictureKind::Albedo), (AlignedBy::PictureAndChannel, PictureKind::AlbedoAligned)];
    let mut mismatches = Vec::new();
    for alignment in &file.alignments {
        let Some((_, picture)) = pictures.iter().find(|(scales, _)| *scales == alignment.scales) else { continue };
        let key = ResultKey::whole(*picture, alignment.views, Metric::Mse);
        let expected = of_scene.and_then(|keys| keys.get(&key)).copied();
        if expected.is_none_or(|expected| (expected - alignment.mse).abs() > 1e-9 * expected.max(1e-12)) {
            mismatches.push(Mismatch::Score { key, scene: file.scene.clone(), expected, found: alignment.mse });
        }
    }
    ReportError::refuse(mismatches)
}
