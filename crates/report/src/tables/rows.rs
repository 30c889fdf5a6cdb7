//! Where a table's numbers come from: one row a method, in groups.

use std::collections::BTreeMap;

use mateval_scene::SceneId;

use super::Grouping;
use super::pooled::{OTHER, pooled};
use mateval_eval::result::{ProtocolResult, ResultFile};

/// A number and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Value {
    pub(crate) value: f64,
    /// That render noise makes, in the value's unit.
    pub(crate) standard_error: Option<f64>,
}

/// One method's numbers.
pub(super) struct Row {
    pub(super) method: String,
    /// By `<picture>.<views>.<metric>`.
    pub(super) values: BTreeMap<String, Value>,
}

/// Rows that are held against each other.
pub(super) struct Group {
    /// The scene or category; empty for the whole dataset.
    pub(super) name: String,
    pub(super) rows: Vec<Row>,
}

/// The groups; methods in the order of the results. Scenes are in the dataset's order, categories in that of their names,
/// `other` last.
pub(super) fn groups(results: &[ResultFile], protocol: &str, grouping: Grouping) -> Vec<Group> {
    let scored: Vec<(&str, &ProtocolResult)> =
        results.iter().filter_map(|result| Some((result.method.as_str(), result.protocols.get(protocol)?))).collect();
    let group = |name: &str, values: &dyn Fn(usize, &ProtocolResult) -> BTreeMap<String, Value>| {
        let row = |(at, (method, scores)): (usize, &(&str, &ProtocolResult))| Row {
            method: (*method).to_owned(),
            values: values(at, scores),
        };
        Group { name: name.to_owned(), rows: scored.iter().enumerate().map(row).collect() }
    };
    match grouping {
        Grouping::Dataset => vec![group("", &|_, scores| of_dataset(scores))],
        Grouping::Scene => {
            let scenes = results.first().map_or(&[][..], |result| &result.dataset.scenes);
            scenes.iter().map(|scene| group(scene.as_str(), &|_, scores| of_scene(scores, scene))).collect()
        }
        Grouping::Category | Grouping::SuperCategory => {
            let by_method: Vec<_> = scored.iter().map(|(_, scores)| pooled(&scores.instances, grouping)).collect();
            let mut names: Vec<&String> = by_method.iter().flat_map(BTreeMap::keys).collect();
            names.sort_by_key(|name| (*name == OTHER, *name));
            names.dedup();
            let of = |at: usize, name: &String| by_method[at].get(name).cloned().unwrap_or_default();
            names.into_iter().map(|name| group(name, &|at, _| of(at, name))).collect()
        }
    }
}

fn of_dataset(scores: &ProtocolResult) -> BTreeMap<String, Value> {
    let value = |(key, value): (&String, &f64)| {
        (key.clone(), Value { value: *value, standard_error: scores.summary_noise.get(key).copied() })
    };
    scores.summary.iter().map(value).collect()
}

fn of_scene(scores: &ProtocolResult, scene: &SceneId) -> BTreeMap<String, Value> {
    let noise = scores.noise.get(scene);
    let value = |(key, value): (&String, &f64)| {
        let standard_error = noise.and_then(|noise| noise.get(key)?.standard_error_db);
        (key.clone(), Value { value: *value, standard_error })
    };
    scores.scenes.get(scene).into_iter().flatten().map(value).collect()
}
