//! What every page shows about a method that it names, and about one of its numbers.

use mateval_scene::submission::Cost;
use serde::Serialize;

use mateval_eval::result::ResultFile;
use mateval_eval::result_key::ResultKey;

use super::columns::Column;
use super::facts::seconds;
use super::file::LeaderboardMethod;
use super::verified::Verified;
use crate::ranking::file::{RankRange, RankedMethod, Ranking, Standing};

/// A method, as pages name it.
#[derive(Clone, Serialize)]
pub(super) struct MethodHead {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) verified: Verified,
    description: String,
    /// Only if it leads to a web page, as the submission is untrusted.
    link: Option<String>,
    licence: Option<String>,
    cost: Option<Cost>,
    /// Its cost, rounded.
    seconds: String,
    partial: bool,
    /// The number of scenes that it is ranked on.
    covered: usize,
    /// The number of scenes of the leaderboard.
    scenes: usize,
    /// The number of scenes that the submission leaves out, scored as grey.
    left_out: usize,
    /// The stems of maps that the submission never contains.
    not_predicted: Vec<String>,
}

impl MethodHead {
    pub(super) fn new(
        ranked: &RankedMethod,
        method: &LeaderboardMethod,
        result: &ResultFile,
        ranking: &Ranking,
    ) -> Self {
        let is_page = |url: &String| url.starts_with("https://") || url.starts_with("http://");
        let scenes = ranking.scenes.len();
        Self {
            id: ranked.id.clone(),
            name: ranked.method.clone(),
            verified: method.verified,
            description: method.description.clone(),
            link: method.url.clone().filter(is_page),
            licence: method.licence.clone().filter(|licence| !licence.is_empty()),
            seconds: method.cost.as_ref().map_or_else(String::new, |cost| seconds(cost.seconds_a_scene)),
            cost: method.cost.clone(),
            partial: ranked.partial,
            covered: scenes - ranked.not_scored.len() - ranked.left_out.len(),
            scenes,
            left_out: ranked.left_out.len(),
            not_predicted: result.not_predicted.clone(),
        }
    }
}

/// One number of a method with its interval and its ranks.
#[derive(Serialize)]
pub(super) struct Cell {
    /// The number that scripts sort by.
    value: String,
    low: Option<String>,
    high: Option<String>,
    text: String,
    interval: Option<String>,
    rank: String,
}

impl Cell {
    pub(super) fn new(column: &Column, standing: &Standing) -> Self {
        let interval = standing.interval.as_ref();
        Self {
            value: seven_digits(standing.value),
            low: interval.map(|interval| seven_digits(interval.low)),
            high: interval.map(|interval| seven_digits(interval.high)),
            text: column.text(standing.value),
            interval: interval.map(|i| format!("{} – {}", column.text(i.low), column.text(i.high))),
            rank: rank_text(standing.rank),
        }
    }
}

/// The value with seven digits, which a page does not need more of; the downloads have all digits.
fn seven_digits(value: f64) -> String {
    format!("{value:.6e}").parse().map_or_else(|_| value.to_string(), |rounded: f64| rounded.to_string())
}

/// `2`, or `2–5`.
pub(super) fn rank_text(rank: RankRange) -> String {
    if rank.best == rank.worst { rank.best.to_string() } else { format!("{}–{}", rank.best, rank.worst) }
}

/// The standing of a method by one number; none if it has no such number.
pub(super) fn standing<'a>(ranking: &'a Ranking, key: ResultKey, method: &str) -> Option<&'a Standing> {
    ranking.keys.get(&key)?.standings.iter().find(|standing| standing.method == method)
}
