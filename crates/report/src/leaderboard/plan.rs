//! What a leaderboard is made from.

use std::path::{Path, PathBuf};

use mateval_eval::result::ResultFile;
use mateval_scene::dataset::SceneFile;
use mateval_scene::open::Dataset;

use super::errata::ErrataFile;
use super::verified::Verified;
use crate::ranking::file::Ranking;
use crate::strips::Shown;

/// What a leaderboard is made from.
pub struct LeaderboardPlan<'a> {
    /// The results.
    pub results: &'a [ResultFile],
    /// The result of the truth itself, which is shown below the methods and not ranked.
    pub ceiling: Option<&'a ResultFile>,
    /// Whether each of the results was verified.
    pub verified: Vec<Verified>,
    /// The protocol whose scores are ranked.
    pub protocol: &'a str,
    /// Whether to accept results that lack some scenes.
    pub partial: bool,
    /// Faults that were found after publication.
    pub errata: Option<&'a ErrataFile>,
    /// A set of pictures to show; see [`crate::picture_set`].
    pub pictures: Option<&'a Path>,
    /// Submissions to draw pictures of.
    pub submissions: Option<Submissions<'a>>,
    /// Name and version of the tool.
    pub tool: String,
}

/// Submissions whose pictures are drawn.
pub struct Submissions<'a> {
    /// The dataset that they were scored on.
    pub dataset: &'a Dataset,
    /// Their folders.
    pub folders: Vec<PathBuf>,
    /// Which pictures are drawn of each.
    pub shown: Vec<Shown>,
}

impl Submissions<'_> {
    /// The dataset's scenes that are ranked, in its order.
    pub(super) fn ranked_scenes(&self, ranking: &Ranking) -> Vec<&SceneFile> {
        self.dataset.scenes.iter().filter(|scene| ranking.scenes.contains(&scene.id)).collect()
    }
}
