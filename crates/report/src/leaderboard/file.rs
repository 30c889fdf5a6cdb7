//! `leaderboard.json`: everything that a leaderboard shows about its methods, for programs.

use std::collections::BTreeMap;

use mateval_dataset::dataset::DatasetVersion;
use mateval_dataset::submission::Cost;
use mateval_eval::result::key::ResultKey;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::marks::Verified;
use crate::ranking::file::Ranking;

/// The format of this version of leaderboards.
pub const LEADERBOARD_FORMAT: &str = "mateval-leaderboard/1";

/// Where the file lies in a leaderboard's folder; what has no such file is not a leaderboard and is never replaced.
pub(super) const LEADERBOARD_PATH: &str = "downloads/leaderboard.json";

/// A leaderboard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LeaderboardFile {
    /// Always `mateval-leaderboard/1`.
    pub format: String,
    /// The tool that wrote it, as in `mateval 0.1.0`.
    pub tool: String,
    /// The dataset that all submissions were scored on.
    pub dataset: DatasetVersion,
    /// The scores of the truth itself, which no method is expected to exceed; they are not ranked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ceiling: Option<Ceiling>,
    /// What each submission states about its method, in the ranking's order.
    pub methods: Vec<LeaderboardMethod>,
    /// Scores, intervals and ranks.
    pub ranking: Ranking,
}

/// The scores of the truth itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ceiling {
    /// The name of its submission.
    pub method: String,
    /// Means over scenes.
    pub values: BTreeMap<ResultKey, f64>,
    /// The standard errors of means of PSNR due to render noise, in dB; light alone has them.
    pub standard_errors_db: BTreeMap<ResultKey, f64>,
}

/// What a submission states about its method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LeaderboardMethod {
    /// Its id in the ranking.
    pub id: String,
    /// Its description.
    pub description: String,
    /// Where to read about it.
    pub url: Option<String>,
    /// Its licence.
    pub licence: Option<String>,
    /// Its cost.
    pub cost: Option<Cost>,
    /// Datasets that it was trained on.
    pub trained_on: Vec<String>,
    /// Those of them from which scenes of the dataset come.
    pub overlap: Vec<String>,
    /// Whether it was made from the ground truth: a bound, and no method.
    pub oracle: bool,
    /// Whether its result was verified.
    pub verified: Verified,
}
