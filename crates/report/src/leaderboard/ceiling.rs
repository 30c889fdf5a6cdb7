//! The truth's own scores: what the best possible method reaches.

use mateval_eval::result::ResultFile;

use super::file::Ceiling;
use crate::error::ReportError;
use crate::mismatch::Mismatch;
use crate::ranking::file::Ranking;
use crate::truth_noise;

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
    let values = scores.map(|scores| scores.summary.clone()).unwrap_or_default();
    let noise = |key: &_| Some((*key, truth_noise::of_dataset(scores?, key)?));
    let truth_noise_db = values.keys().filter_map(noise).collect();
    Ok(Ceiling { method: result.method.clone(), values, truth_noise_db })
}
