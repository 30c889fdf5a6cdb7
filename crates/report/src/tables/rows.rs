//! The numbers of a table: one row for each method, in groups.

use std::collections::BTreeMap;

use mateval_scene::SceneId;

use super::grouping::Grouping;
use super::pooled::{OTHER, pooled};
use super::value::{CellKey, Value};
use crate::truth_noise;
use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_eval::result_key::ResultKey;

/// One method's numbers.
pub(super) struct Row {
    pub(super) method: String,
    pub(super) values: BTreeMap<CellKey, Value>,
}

/// Rows that are compared with each other.
pub(super) struct Group {
    /// The scene or category; empty for the whole dataset.
    pub(super) name: String,
    pub(super) rows: Vec<Row>,
    /// The truth's own numbers, which no method is expected to exceed.
    pub(super) ceiling: Option<Row>,
}

/// The groups, with methods in the order of the results. Scenes are in the dataset's order, categories by name with
/// `other` last.
pub(super) fn groups(
    results: &[ResultFile],
    ceiling: Option<&ResultFile>,
    protocol: &str,
    grouping: Grouping,
) -> Vec<Group> {
    let all = results.iter().chain(ceiling);
    let scored: Vec<(String, &ProtocolResult)> =
        all.filter_map(|result| Some((result.shown_method(), result.protocols.get(protocol)?))).collect();
    let group = |name: &str, values: &dyn Fn(usize, &ProtocolResult) -> BTreeMap<CellKey, Value>| {
        let row = |(at, (method, scores)): (usize, &(String, &ProtocolResult))| Row {
            method: method.clone(),
            values: values(at, scores),
        };
        let mut rows: Vec<Row> = scored.iter().enumerate().map(row).collect();
        let ceiling = ceiling.and_then(|_| rows.pop());
        Group { name: name.to_owned(), rows, ceiling }
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

fn of_dataset(scores: &ProtocolResult) -> BTreeMap<CellKey, Value> {
    let value = |(key, value): (&ResultKey, &f64)| {
        let standard_error = scores.summary_noise.get(key).copied();
        let truth_noise = truth_noise::of_dataset(scores, key);
        (CellKey::from(*key), Value { value: *value, standard_error, truth_noise })
    };
    scores.summary.iter().map(value).collect()
}

fn of_scene(scores: &ProtocolResult, scene: &SceneId) -> BTreeMap<CellKey, Value> {
    let noise = scores.noise.get(scene);
    let value = |(key, value): (&ResultKey, &f64)| {
        let standard_error = noise.and_then(|noise| noise.get(key)?.standard_error_db);
        let truth_noise = truth_noise::of_scene(scores, scene, key);
        (CellKey::from(*key), Value { value: *value, standard_error, truth_noise })
    };
    scores.scenes.get(scene).into_iter().flatten().map(value).collect()
}
