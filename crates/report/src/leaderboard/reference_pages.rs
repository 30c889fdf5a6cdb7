//! The pages that explain the others: about the board, the protocol, and errata.

use mateval_dataset::dataset::DatasetVersion;
use mateval_dataset::ids::counted;
use mateval_dataset::open::Dataset;
use mateval_eval::protocol::Protocol;
use minijinja::context;
use minijinja::value::Serde;
use pulldown_cmark::html::push_html;
use pulldown_cmark::{Event, Parser, Tag};
use serde::Serialize;
use serde_json::Value;

use super::board::Board;
use super::entries::LeaderboardPlan;
use super::marks::Verified;
use super::site::{Page, SiteWriter};
use crate::error::ReportError;
use crate::ranking::file::{IntervalKind, RankingRules};

/// Writes `about.html`, `protocol.html` and `errata.html`.
pub(super) fn write(board: &Board<'_>, plan: &LeaderboardPlan<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    write_about(board, plan, site)?;
    write_protocol(board, site)?;
    let errata = plan.errata.map_or(&[][..], |errata| &errata.entries);
    site.page(&Page {
        file: "errata.html",
        template: "errata.j2",
        title: "Errata",
        scripts: &[],
        values: context! { errata => Serde(errata) },
    })
}

/// Writes `about.html`: what the keeper says, and what holds for every board.
fn write_about(board: &Board<'_>, plan: &LeaderboardPlan<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let mut said = String::new();
    push_html(&mut said, Parser::new(plan.about.unwrap_or_default()).map(harmless));
    let count = |state| plan.verified.iter().filter(|mark| **mark == state).count();
    site.page(&Page {
        file: "about.html",
        template: "about.j2",
        title: "About",
        scripts: &[],
        values: context! {
            said, dataset => Serde(&board.file.dataset),
            verified => count(Verified::Confirmed), claimed => count(Verified::Claimed) + count(Verified::Stale),
            refuted => count(Verified::Refuted),
            licences => plan.submissions.as_ref().map(|given| licences(given.dataset)),
        },
    })
}

/// The first line of each licence of a dataset with the number of its scenes, and the scenes without one.
fn licences(dataset: &Dataset) -> Vec<String> {
    let stated = dataset.file.shared_licences().into_iter().map(|licence| {
        let first = licence.text.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or_default();
        format!("{first} ({})", counted(licence.scenes.len(), "scene"))
    });
    stated.chain(dataset.unstated_licences()).collect()
}

/// Markdown without what a script could hide in: the text may come with a pull request. HTML is shown as text,
/// links lead to web pages and mail alone, and no picture is loaded, since a site loads nothing from elsewhere.
fn harmless(event: Event<'_>) -> Event<'_> {
    let is_safe = |url: &str| ["https://", "http://", "mailto:"].iter().any(|start| url.starts_with(start));
    match event {
        Event::Html(text) | Event::InlineHtml(text) => Event::Text(text),
        Event::Start(Tag::Link { link_type, dest_url, title, id }) if !is_safe(&dest_url) => {
            Event::Start(Tag::Link { link_type, dest_url: "".into(), title, id })
        }
        Event::Start(Tag::Image { link_type, title, id, .. }) => {
            Event::Start(Tag::Image { link_type, dest_url: "".into(), title, id })
        }
        other => other,
    }
}

#[derive(Serialize)]
struct ProtocolPage<'a> {
    dataset: &'a DatasetVersion,
    weights: Option<&'a String>,
    protocol_sha256: String,
    rules: Vec<Rule>,
    ranking: &'a RankingRules,
    percent: u32,
    /// How intervals were found; none if there are no intervals.
    kind: Option<IntervalKind>,
}

/// Writes `protocol.html`: the fingerprint and everything that it is a hash of.
fn write_protocol(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
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

/// A number or word of a protocol.
#[derive(Serialize)]
struct Rule {
    /// The path of its key.
    path: String,
    value: String,
    /// What the key means, in the words of the protocol's schema.
    meaning: String,
}

/// Every number and word of a protocol.
fn rules_of(protocol: &Protocol) -> Vec<Rule> {
    let mut rules = Vec::new();
    // From its JSON text, which gives single-precision numbers with as few digits as they need.
    let value = serde_json::from_str(&mateval_dataset::json::to_text(protocol)).unwrap_or(Value::Null);
    leaves(&value, String::new(), &mut rules);
    let schema = schemars::schema_for!(Protocol);
    let rule = |(path, value): (String, String)| {
        let meaning = meaning(schema.as_value(), &path).unwrap_or_default().replace('`', "");
        Rule { path, value, meaning }
    };
    rules.into_iter().map(rule).collect()
}

/// The description of the key at a path, or else of its type.
fn meaning<'a>(schema: &'a Value, path: &str) -> Option<&'a str> {
    let resolved = |at: &'a Value| match at.get("$ref").and_then(Value::as_str) {
        Some(place) => schema.pointer(place.trim_start_matches('#')).unwrap_or(at),
        None => at,
    };
    let described = |at: &'a Value| at.get("description").and_then(Value::as_str);
    let (mut at, mut said) = (schema, None);
    for word in path.split('.') {
        // Keys that may be null are a choice between their type and null.
        let own = resolved(at);
        let choices = own.get("anyOf").and_then(Value::as_array).and_then(|choices| choices.first());
        let own = choices.map_or(own, resolved);
        // Constants by name are described together.
        let by_name = || own.get("additionalProperties").filter(|values| values.is_object());
        at = own.get("properties").and_then(|keys| keys.get(word)).or_else(by_name)?;
        said = described(at).or_else(|| described(resolved(at))).or(said);
    }
    said
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_about_the_board_runs_nothing_and_loads_nothing() {
        let html = |text: &str| {
            let mut html = String::new();
            push_html(&mut html, Parser::new(text).map(harmless));
            html
        };
        let hostile = "<script>a()</script>\n\nb <img src=x onerror=c()> [d](javascript:e) ![f](https://g/h.png)";
        let shown = html(hostile);
        assert!(
            !shown.contains("<script") && !shown.contains("<img src=x") && !shown.contains("javascript:"),
            "{shown}"
        );
        assert!(!shown.contains("https://g"), "{shown}");
        // Twin.
        assert!(html("[paper](https://e.org/a)").contains("<a href=\"https://e.org/a\">paper</a>"));
    }

    #[test]
    fn every_rule_has_a_meaning() {
        for name in ["mateval-3", "paper"] {
            let rules = rules_of(&Protocol::named(name).unwrap());
            assert!(rules.len() > 60, "{name}");
            let silent: Vec<&str> =
                rules.iter().filter(|rule| rule.meaning.is_empty()).map(|rule| rule.path.as_str()).collect();
            assert!(silent.is_empty(), "{name}: {silent:?}");
        }
        assert_eq!(meaning(schemars::schema_for!(Protocol).as_value(), "light.no_key"), None);
    }
}
