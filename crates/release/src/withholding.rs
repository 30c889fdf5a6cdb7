//! Removes from a report what must not become public while the ground truth is withheld: everything that was measured on it
//! in single scenes, and every sentence that may quote it. What remains of it are means over scenes, as a leaderboard
//! shows them too, the counts of checks, and the settings of the renderer.

use mateval_scene::Finding;

use crate::file::{ReleaseFile, Withheld};
use crate::reference_scores::ReferenceScores;

/// In place of sentences that may quote the ground truth.
pub(crate) const NOT_SHOWN: &str = "not shown, since the ground truth is withheld";

/// Removes it.
pub(crate) fn withhold(file: &mut ReleaseFile, commitment_sha256: String) {
    file.withheld = Some(Withheld { commitment_sha256 });
    file.verification.findings.iter_mut().for_each(silence);
    [&mut file.ceiling, &mut file.floor].into_iter().flatten().for_each(only_means);
    for scene in &mut file.scenes {
        scene.noise = None;
        if let Some(verdict) = &mut scene.comparison {
            verdict.faults = None;
        }
    }
}

/// Keeps the kind of a finding and its file. Any message of the verification may quote a pixel.
fn silence(finding: &mut Finding) {
    finding.place.clear();
    finding.message = NOT_SHOWN.to_owned();
    finding.action = "run `mateval prep verify` on the whole dataset".to_owned();
}

/// Keeps means over two scenes or more: the mean over one scene is that scene's score.
fn only_means(scores: &mut ReferenceScores) {
    if let Some(scenes) = scores.scenes.take() {
        scores.summary.retain(|key, _| scenes.values().filter(|values| values.contains_key(key)).count() >= 2);
    }
    if scores.scenes_scored < 2 {
        scores.summary.clear();
    }
    scores.summary_noise.retain(|key, _| scores.summary.contains_key(key));
    scores.noise = None;
}
