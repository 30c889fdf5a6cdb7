//! Everything that the pages of a leaderboard are made from.

use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_scene::SceneId;
use mateval_scene::dataset_id::DatasetId;

use super::columns::{self, Column};
use super::file::{Ceiling, LEADERBOARD_FORMAT, LeaderboardDataset, LeaderboardFile, LeaderboardMethod};
use super::heads::MethodHead;
use super::plan::LeaderboardPlan;
use super::verified::Verified;
use crate::picture_set::PictureSet;
use crate::ranking::file::{RankedMethod, Ranking};

/// Everything that pages are made from. Results, scores and heads are in the order of the ranking's methods.
pub(super) struct Board<'a> {
    pub(super) results: &'a [ResultFile],
    /// The result of the truth itself.
    pub(super) ceiling: Option<&'a ResultFile>,
    pub(super) scores: Vec<&'a ProtocolResult>,
    pub(super) file: LeaderboardFile,
    pub(super) heads: Vec<MethodHead>,
    pub(super) columns: Vec<Column>,
    pub(super) pictures: PictureSet,
}

impl<'a> Board<'a> {
    /// Gathers what pages show from the plan's results and their ranking.
    pub(super) fn new(
        plan: &LeaderboardPlan<'a>,
        ranking: Ranking,
        ceiling: Option<Ceiling>,
        pictures: PictureSet,
    ) -> Self {
        let method = |((method, result), verified): ((&RankedMethod, &ResultFile), &Verified)| {
            let submission = result.submission.clone();
            LeaderboardMethod {
                id: method.id.clone(),
                description: submission.description,
                url: submission.url,
                licence: submission.licence,
                cost: submission.cost,
                verified: *verified,
            }
        };
        let methods: Vec<_> = ranking.methods.iter().zip(plan.results).zip(&plan.verified).map(method).collect();
        // The ranking has refused an empty list.
        let dataset = plan.results.first().map(|result| &result.dataset);
        let text = |of: fn(&DatasetId) -> &String| dataset.map(of).cloned().unwrap_or_default();
        let dataset = LeaderboardDataset {
            name: text(|dataset| &dataset.name),
            version: text(|dataset| &dataset.version),
            manifest_sha256: text(|dataset| &dataset.manifest_sha256),
        };
        let heads =
            ranking.methods.iter().zip(&methods).map(|(ranked, method)| MethodHead::new(ranked, method, &ranking));
        Self {
            results: plan.results,
            ceiling: plan.ceiling,
            scores: plan.results.iter().filter_map(|result| result.protocols.get(plan.protocol)).collect(),
            heads: heads.collect(),
            columns: columns::columns(&ranking),
            pictures,
            file: LeaderboardFile {
                format: LEADERBOARD_FORMAT.to_owned(),
                tool: plan.tool.clone(),
                dataset,
                ceiling,
                methods,
                ranking,
            },
        }
    }

    pub(super) fn ranking(&self) -> &Ranking {
        &self.file.ranking
    }

    /// The column that the board is sorted by initially.
    pub(super) fn first(&self) -> Option<&Column> {
        columns::first(&self.columns)
    }

    /// The values of the method at place `at` for a scene, as tables show them; none where the scene has no such value.
    pub(super) fn texts(&self, at: usize, scene: &SceneId, columns: &[&Column]) -> Vec<Option<String>> {
        let values = self.scores[at].scenes.get(scene);
        columns.iter().map(|column| Some(column.text(*values?.get(&column.key)?))).collect()
    }
}
