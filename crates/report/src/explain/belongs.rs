//! Whether a result, a dataset and a submission belong together.

use mateval_scene::submission::SUBMISSION;

use super::file::{AlignedBy, ExplainFile};
use super::plan::ExplainPlan;
use crate::error::ReportError;
use mateval_eval::metric::Metric;
use mateval_eval::protocol::SCORER_VERSION;
use mateval_eval::result::{ProtocolResult, RESULT_FORMAT};
use mateval_eval::result_key::{PictureKind, ResultKey};
use mateval_submission::hashed_submission::{HashedSubmission, hashed_submission};

/// The scores that are to be explained; fails with everything that does not fit.
pub(super) fn check<'a>(plan: &ExplainPlan<'a>) -> Result<&'a ProtocolResult, ReportError> {
    let (result, dataset) = (plan.result, plan.dataset);
    if result.format != RESULT_FORMAT {
        let what = format!("the result is of format '{}'; this version reads '{RESULT_FORMAT}'", result.format);
        return Err(ReportError::Invalid(what));
    }
    let scores = plan.scores()?;
    let mut faults = Vec::new();
    if scores.protocol.scorer_version != SCORER_VERSION {
        let found = scores.protocol.scorer_version;
        faults
            .push(format!("the result is of scorer version {found}, this program of {SCORER_VERSION}; score it again"));
    }
    if result.dataset.manifest_sha256 != dataset.file.manifest_sha256 {
        faults.push(format!(
            "the result was made on '{}' {} with manifest {}, but the dataset '{}' is '{}' {} with manifest {}",
            result.dataset.name,
            result.dataset.version,
            result.dataset.manifest_sha256,
            dataset.root.display(),
            dataset.file.name,
            dataset.file.version,
            dataset.file.manifest_sha256
        ));
    }
    if !result.dataset.scenes.contains(plan.scene) {
        let known: Vec<&str> = result.dataset.scenes.iter().map(mateval_scene::SceneId::as_str).collect();
        faults.push(format!("scene '{}' was not scored; the result has: {}", plan.scene, known.join(", ")));
    }
    if faults.is_empty() {
        faults.extend(submission_fault(plan)?);
    }
    if faults.is_empty() { Ok(scores) } else { Err(ReportError::Invalid(faults.join("; "))) }
}

/// The hash is one over all scored scenes: it tells that a file differs, not which.
fn submission_fault(plan: &ExplainPlan<'_>) -> Result<Option<String>, ReportError> {
    let (result, path) = (plan.result, plan.submission);
    let HashedSubmission { method, sha256: found, maps } =
        hashed_submission(path, plan.dataset, &result.dataset.scenes)?;
    Ok((found != result.submission.sha256).then(|| {
        format!(
            "the result was made of '{}' with hash {}, but the submission '{}' is '{}' with hash {found} over \
             {SUBMISSION} and its {maps} maps of the scored scenes: it is another one, or one of these files has changed; \
             score it again",
            result.method,
            result.submission.sha256,
            path.display(),
            method
        )
    }))
}

/// Fails where the pictures that were made anew have not the scores that the result has: then the explanation would be of
/// something else.
pub(super) fn check_scores(scores: &ProtocolResult, file: &ExplainFile) -> Result<(), ReportError> {
    let of_scene = scores.scenes.get(&file.scene);
    let pictures = [(AlignedBy::None, PictureKind::Albedo), (AlignedBy::PictureAndChannel, PictureKind::AlbedoAligned)];
    for alignment in &file.alignments {
        let Some((_, picture)) = pictures.iter().find(|(scales, _)| *scales == alignment.scales) else { continue };
        let key = ResultKey::whole(*picture, alignment.views, Metric::Mse);
        let expected = of_scene.and_then(|keys| keys.get(&key)).copied();
        if expected.is_none_or(|expected| (expected - alignment.mse).abs() > 1e-9 * expected.max(1e-12)) {
            let expected = expected.map_or("missing".to_owned(), |expected| expected.to_string());
            return Err(ReportError::Invalid(format!(
                "'{key}' of scene '{}' is {expected} in the result, but {} made anew; the result was made by another \
                 version or has been changed; score it again",
                file.scene, alignment.mse
            )));
        }
    }
    Ok(())
}
