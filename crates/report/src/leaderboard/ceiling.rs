//! The truth's own scores: what the best possible method reaches.

use mateval_eval::result::ResultFile;

use super::file::Ceiling;
use crate::error::ReportError;
use crate::mismatch::Mismatch;
use crate::ranking::file::Ranking;

/// The scores of the truth's `result`. Fails if it was not scored on the scenes and under the rules of the ranking.
pub(super) fn of(result: &ResultFile, ranking: &Ranking) -> Result<Ceiling, ReportError> {
    let mut mismatches: Vec<Mismatch> = Mismatch::of_result(result, &ranking.protocol).into_iter().collect();
    let first = ranking.methods.first().map_or_else(String::new, |method| method.method.clone());
    let other = result.method.clone();
    let scores = result.protocols.get(&ranking.protocol);
    if result.dataset.scenes != ranking.scenes {
        mismatches.push(Mismatch::Scenes { first, other });
    } else if scores.is_some_and(|scores| scores.fingerprint != ranking.fingerprint) {
        mismatches.push(Mismatch::Fingerprints { first, other });
    }
    ReportError::refuse(mismatches)?;
    let (values, standard_errors_db) =
        scores.map(|scores| (scores.summary.clone(), scores.summary_noise.clone())).unwrap_or_default();
    Ok(Ceiling { method: result.method.clone(), values, standard_errors_db })
}
