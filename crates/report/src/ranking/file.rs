//! A ranking, as `leaderboard.json` holds it.

use std::collections::BTreeMap;

use mateval_dataset::SceneId;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mateval_eval::metric::Better;
use mateval_eval::result::key::ResultKey;

/// Differences with a corrected p-value below this are significant.
pub(super) const LEVEL: f64 = 0.05;

/// Methods ranked under one protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ranking {
    /// The protocol's name.
    pub protocol: String,
    /// The fingerprint of all results; with partial results, the one that a result on all of `scenes` would have.
    pub fingerprint: String,
    /// How houses were drawn and methods compared.
    pub rules: RankingRules,
    /// The scenes that any result covers, in the dataset's order.
    pub scenes: Vec<SceneId>,
    /// The house of each scene; scenes of one house are drawn together.
    pub houses: BTreeMap<SceneId, String>,
    /// In the order in which the results were given.
    pub methods: Vec<RankedMethod>,
    /// The ranking by each score.
    pub keys: BTreeMap<ResultKey, KeyRanking>,
}

/// How houses were drawn and methods compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RankingRules {
    /// The seed of the random numbers.
    pub seed: u64,
    /// The number of draws of houses.
    pub draws: usize,
    /// The share of cases in which an interval holds the mean.
    pub confidence: f64,
    /// Differences with a corrected p-value below this are significant.
    pub level: f64,
    /// With fewer houses, intervals are of kind `student`.
    pub student_below: usize,
    /// With fewer houses, there are no intervals and no significant differences.
    pub least_houses: usize,
}

/// One method.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RankedMethod {
    /// Its name made safe for files and links, followed by a number if another method has the same.
    pub id: String,
    /// Its name.
    pub method: String,
    /// The hash of its submission.
    pub submission_sha256: String,
    /// Scenes that were not scored.
    pub not_scored: Vec<SceneId>,
    /// Scenes that were scored, but for which the submission has no base colour: scored as grey.
    pub left_out: Vec<SceneId>,
    /// Whether it is ranked only on the scenes that it covers.
    pub partial: bool,
}

/// The ranking by one score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KeyRanking {
    /// Whether more is better.
    pub better: Better,
    /// Methods that have this score, in the order of `methods`.
    pub standings: Vec<Standing>,
    /// All pairs of them.
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
    /// Null if there are too few houses.
    pub interval: Option<Interval>,
    /// The number of scenes that have this score.
    pub scenes: usize,
    /// The number of their houses.
    pub houses: usize,
    /// From 1 + the number of methods that are significantly better to the number of methods that are not significantly
    /// worse.
    pub rank: RankRange,
}

/// The interval that holds, with 95 % confidence, the mean over all houses of the kind that was scored.
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

/// The comparison of two methods on the scenes that both have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pair {
    /// The id of a method.
    pub first: String,
    /// The id of another method.
    pub second: String,
    /// The number of scenes that both have.
    pub scenes: usize,
    /// The mean of the first minus the mean of the second; null without such scenes.
    pub difference: Option<f64>,
    /// The share of draws in which the first is better; equal means count half. Null if there are too few houses.
    pub win: Option<f64>,
    /// p-value of the difference; null if there are too few houses.
    pub p: Option<f64>,
    /// The p-value corrected for all pairs (Holm).
    pub p_holm: Option<f64>,
}

impl Pair {
    pub fn is_significant(&self) -> bool {
        self.p_holm.is_some_and(|p| p < LEVEL)
    }
}
