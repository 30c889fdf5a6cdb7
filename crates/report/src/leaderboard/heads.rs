//! What pages show of a method wherever they name it, and of its numbers.

use mateval_scene::submission::Cost;
use serde::Serialize;

use mateval_eval::result_key::ResultKey;

use super::columns::Column;
use super::file::LeaderboardMethod;
use super::verified::Verified;
use crate::ranking::file::{RankRange, RankedMethod, Ranking, Standing};

/// A method.
#[derive(Clone, Serialize)]
pub(super) struct MethodHead {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) verified: Verified,
    description: String,
    /// Only if it leads to a web page: a stranger wrote it.
    link: Option<String>,
    licence: Option<String>,
    /// As much of it as a row of the table has room for.
    licence_in_brief: String,
    cost: Option<Cost>,
    hardware_in_brief: String,
    /// Its cost, rounded.
    seconds: String,
    partial: bool,
    /// Scenes that it is ranked on, if it is partial.
    covered: usize,
    /// Scenes that all have.
    scenes: usize,
    /// Scenes that it left to be grey.
    left_out: usize,
}

impl MethodHead {
    pub(super) fn new(ranked: &RankedMethod, said: &LeaderboardMethod, ranking: &Ranking) -> Self {
        let is_page = |url: &String| url.starts_with("https://") || url.starts_with("http://");
        let scenes = ranking.scenes.len();
        Self {
            id: ranked.id.clone(),
            name: ranked.method.clone(),
            verified: said.verified,
            description: said.description.clone(),
            link: said.url.clone().filter(is_page),
            licence: said.licence.clone().filter(|licence| !licence.is_empty()),
            licence_in_brief: in_brief(said.licence.as_deref().unwrap_or_default()),
            hardware_in_brief: in_brief(said.cost.as_ref().map_or("", |cost| &cost.hardware)),
            seconds: said.cost.as_ref().map_or_else(String::new, |cost| seconds(cost.seconds_a_scene)),
            cost: said.cost.clone(),
            partial: ranked.partial,
            covered: scenes - ranked.not_scored.len() - ranked.left_out.len(),
            scenes,
            left_out: ranked.left_out.len(),
        }
    }
}

/// What a stranger says of his cost has no bound; a column has.
fn seconds(seconds: f64) -> String {
    match seconds {
        1e7.. => format!("{seconds:.1e}"),
        100.0.. => format!("{seconds:.0}"),
        _ => format!("{seconds:.1}"),
    }
}

/// The text, or its first 60 characters.
fn in_brief(text: &str) -> String {
    let cut = text.char_indices().nth(60);
    cut.map_or_else(|| text.to_owned(), |(end, _)| format!("{}…", &text[..end]))
}

/// A number of a method with all that is known of it.
#[derive(Serialize)]
pub(super) struct Cell {
    /// All digits, as scripts sort by.
    value: String,
    low: Option<String>,
    high: Option<String>,
    text: String,
    interval: Option<String>,
    rank: String,
    is_shown: bool,
}

impl Cell {
    pub(super) fn new(column: &Column, standing: &Standing) -> Self {
        let interval = standing.interval.as_ref();
        Self {
            value: short(standing.value),
            low: interval.map(|interval| short(interval.low)),
            high: interval.map(|interval| short(interval.high)),
            text: column.text(standing.value),
            interval: interval.map(|i| format!("{} – {}", column.text(i.low), column.text(i.high))),
            rank: rank_text(standing.rank),
            is_shown: column.is_shown,
        }
    }
}

/// Seven digits tell all values apart that a page need tell apart; the downloads have all.
fn short(value: f64) -> String {
    format!("{value:.6e}").parse().map_or_else(|_| value.to_string(), |rounded: f64| rounded.to_string())
}

/// `2`, or `2–5`.
pub(super) fn rank_text(rank: RankRange) -> String {
    if rank.best == rank.worst { rank.best.to_string() } else { format!("{}–{}", rank.best, rank.worst) }
}

/// The method's place by one number.
pub(super) fn standing<'a>(ranking: &'a Ranking, key: ResultKey, method: &str) -> Option<&'a Standing> {
    ranking.keys.get(&key)?.standings.iter().find(|standing| standing.method == method)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_has_room_for_what_a_method_says_of_itself() {
        assert_eq!(
            [0.04, 12.34, 99.96, 123.4, 9_999_999.0, 1e300].map(seconds),
            ["0.0", "12.3", "100.0", "123", "9999999", "1.0e300"]
        );
        assert_eq!(in_brief("MIT"), "MIT");
        assert_eq!(in_brief(&"é".repeat(60)), "é".repeat(60));
        assert_eq!(in_brief(&"é".repeat(61)), format!("{}…", "é".repeat(60)));
    }
}
