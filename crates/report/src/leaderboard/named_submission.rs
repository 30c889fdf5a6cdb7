//! The methods that the given submissions belong to.

use std::path::Path;

use mateval_scene::SceneId;
use mateval_submission::hashed_submission::HashedFiles;

use super::plan::LeaderboardPlan;
use crate::error::ReportError;
use crate::ranking::file::{RankedMethod, Ranking};

/// A submission and the method that it belongs to.
pub(super) struct NamedSubmission<'a> {
    /// The method's id.
    pub(super) id: String,
    pub(super) folder: &'a Path,
    /// Scenes of the board that were not scored.
    not_scored: Vec<SceneId>,
}

impl NamedSubmission<'_> {
    /// Whether the method was scored on the scene.
    pub(super) fn covers(&self, scene: &SceneId) -> bool {
        !self.not_scored.contains(scene)
    }
}

/// The given submissions, once for each method whose result states the submission's hash. Fails for a submission that
/// no result states.
pub(super) fn named<'a>(
    plan: &'a LeaderboardPlan<'_>,
    ranking: &Ranking,
) -> Result<Vec<NamedSubmission<'a>>, ReportError> {
    let mut named = Vec::new();
    let Some(from) = &plan.submissions else { return Ok(named) };
    for folder in &from.folders {
        let files = HashedFiles::read(folder, from.dataset, &ranking.scenes)?;
        let is_of = |method: &&RankedMethod| {
            files.over(|scene| !method.not_scored.contains(scene)).sha256 == method.submission_sha256
        };
        let before = named.len();
        named.extend(ranking.methods.iter().filter(is_of).map(|method| NamedSubmission {
            id: method.id.clone(),
            folder,
            not_scored: method.not_scored.clone(),
        }));
        if named.len() == before {
            return Err(ReportError::UnscoredSubmission { path: folder.clone() });
        }
    }
    Ok(named)
}
