//! The page of the protocol: the fingerprint and everything that it is a hash of.

use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;
use serde_json::Value;

use super::board::Board;
use super::file::LeaderboardDataset;
use super::site::{Page, SiteWriter};
use crate::error::ReportError;
use crate::ranking::file::{IntervalKind, RankingRules};
use mateval_eval::protocol::Protocol;

#[derive(Serialize)]
struct ProtocolPage<'a> {
    dataset: &'a LeaderboardDataset,
    weights: Option<&'a String>,
    protocol_sha256: String,
    rules: Vec<(String, String)>,
    ranking: &'a RankingRules,
    percent: u32,
    /// How intervals were found; none if there are no intervals.
    kind: Option<IntervalKind>,
}

/// Writes `protocol.html`.
pub(super) fn write(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let (Some(result), Some(scores)) = (board.results.first(), board.scores.first()) else { return Ok(()) };
    let rules = &board.ranking().rules;
    let intervals = board.ranking().keys.values().flat_map(|key| &key.standings);
    let page = ProtocolPage {
        dataset: &board.file.dataset,
        weights: result.lpips_weights.get(&scores.protocol.fixed.lpips_net).and_then(Option::as_ref),
        protocol_sha256: scores.protocol.sha256(),
        rules: rules_of(&scores.protocol),
        ranking: rules,
        percent: (100.0 * rules.confidence).round() as u32,
        kind: intervals.filter_map(|standing| standing.interval).map(|interval| interval.kind).next(),
    };
    site.page(&Page {
        file: "protocol.html",
        template: "protocol.j2",
        title: "Protocol",
        scripts: &[],
        values: context! { page => Serde(&page) },
    })
}

/// Every number and word of a protocol, with the path of its key.
fn rules_of(protocol: &Protocol) -> Vec<(String, String)> {
    let mut rules = Vec::new();
    // From its JSON text, which gives single-precision numbers with as few digits as they need.
    let value = serde_json::from_str(&mateval_scene::json::to_text(protocol)).unwrap_or(Value::Null);
    leaves(&value, String::new(), &mut rules);
    rules
}

fn leaves(value: &Value, path: String, rules: &mut Vec<(String, String)>) {
    match value {
        Value::Object(map) => {
            let join = |key: &String| if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            map.iter().for_each(|(key, value)| leaves(value, join(key), rules));
        }
        Value::Array(values) => {
            let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            rules.push((path, values.iter().map(text).collect::<Vec<_>>().join(", ")));
        }
        Value::String(word) => rules.push((path, word.clone())),
        other => rules.push((path, other.to_string())),
    }
}
