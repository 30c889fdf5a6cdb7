//! What a ranking says, as the JSON of a leaderboard holds it.

use std::collections::BTreeMap;

use mateval_scene::SceneId;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::holm::LEVEL;
use mateval_eval::metric::Better;
use mateval_eval::result_key::ResultKey;

/// Methods ranked under one protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ranking {
    /// The protocol's name.
    pub protocol: String,
    /// The fingerprint that all have; with partial results that of the protocol on all scenes that any covers.
    pub fingerprint: String,
    /// How it was drawn and judged.
    pub rules: RankingRules,
    /// The scenes that any result covers, in the dataset's order.
    pub scenes: Vec<SceneId>,
    /// The house of each scene: scenes of one are drawn together.
    pub houses: BTreeMap<SceneId, String>,
    /// In the order in which the results were given.
    pub methods: Vec<RankedMethod>,
    /// By each number that can be ranked.
    pub keys: BTreeMap<ResultKey, KeyRanking>,
}

/// How it was drawn and judged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RankingRules {
    /// Of the random numbers.
    pub seed: u64,
    /// Draws of the houses.
    pub draws: usize,
    /// Share of all cases that an interval covers.
    pub confidence: f64,
    /// Corrected chances under this are differences.
    pub level: f64,
    /// Under so many houses intervals are Student's.
    pub student_below: usize,
    /// Under so many houses there are no intervals, and no method is better than another.
    pub least_houses: usize,
}

/// One method.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RankedMethod {
    /// Its name made safe for files and links, with a number behind it where another one has it.
    pub id: String,
    /// Its name.
    pub method: String,
    /// The hash of its submission.
    pub submission_sha256: String,
    /// Scenes that were not scored.
    pub not_scored: Vec<SceneId>,
    /// Scenes that were scored, but of which the submission has no base colour at all: all grey.
    pub left_out: Vec<SceneId>,
    /// Whether it is ranked on what it covers only.
    pub partial: bool,
}

/// The ranking by one number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KeyRanking {
    /// Whether more is better.
    pub better: Better,
    /// Methods that have this number, in the order of `methods`.
    pub standings: Vec<Standing>,
    /// Each two of them.
    pub pairs: Vec<Pair>,
}

/// One method's place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Standing {
    /// The method's id.
    pub method: String,
    /// Mean over its scenes.
    pub value: f64,
    /// Null where there are too few houses.
    pub interval: Option<Interval>,
    /// Scenes that have this number.
    pub scenes: usize,
    /// Their houses.
    pub houses: usize,
    /// From 1 + those that are significantly better to all - those that are significantly worse.
    pub rank: RankRange,
}

/// Where the mean over all houses that could have been drawn lies, with 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// How it was found.
    pub kind: IntervalKind,
}

/// How an interval was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum IntervalKind {
    /// Quantiles of the draws' means.
    Percentile,
    /// Quantiles of the draws' errors over their own standard errors: bootstrap-t.
    Student,
}

/// From the best to the worst rank that the data leave open; 1 is the best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RankRange {
    /// At best.
    pub best: usize,
    /// At worst.
    pub worst: usize,
}

/// Two methods on the scenes that both have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pair {
    /// A method's id.
    pub first: String,
    /// Another's.
    pub second: String,
    /// Scenes that both have.
    pub scenes: usize,
    /// Mean of the first less that of the second; null without such scenes.
    pub difference: Option<f64>,
    /// Share of draws in which the first is better, equal ones count half; null where there are too few houses.
    pub win: Option<f64>,
    /// Chance of a difference as large, if there were none; null where there are too few houses.
    pub p: Option<f64>,
    /// The same corrected for all pairs (Holm).
    pub p_holm: Option<f64>,
}

impl Pair {
    /// Whether their difference is more than chance.
    pub fn is_sure(&self) -> bool {
        self.p_holm.is_some_and(|p| p < LEVEL)
    }
}
