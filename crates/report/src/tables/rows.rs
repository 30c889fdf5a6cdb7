//! The numbers of a table: one row for each method, in groups.

use std::collections::BTreeMap;

use mateval_scene::{SceneId, SourceKind};

use super::grouping::Grouping;
use super::pooled::{OTHER, pooled};
use super::value::{CellKey, Value};
use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_eval::result_key::ResultKey;

/// One method's numbers.
pub(super) struct Row {
    pub(super) method: String,
    pub(super) values: BTreeMap<CellKey, Value>,
    /// The stems of maps that its submission never contains, which have no values.
    pub(super) not_predicted: Vec<String>,
}

impl Row {
    /// Whether the row could have this number: its submission contains the map that the number is about.
    pub(super) fn predicts(&self, key: &CellKey) -> bool {
        key.picture.kind.map().is_none_or(|map| !self.not_predicted.iter().any(|stem| stem == map.stem()))
    }
}

/// Rows that are compared with each other.
pub(super) struct Group {
    /// The scene, category or kind of source; empty for the whole dataset.
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
    let scored: Vec<(&ResultFile, &ProtocolResult)> =
        all.filter_map(|result| Some((result, result.protocols.get(protocol)?))).collect();
    let group = |name: &str, values: &dyn Fn(usize, &ProtocolResult) -> BTreeMap<CellKey, Value>| {
        let row = |(at, (result, scores)): (usize, &(&ResultFile, &ProtocolResult))| Row {
            method: result.shown_method(),
            values: values(at, scores),
            not_predicted: result.not_predicted.clone(),
        };
        let mut rows: Vec<Row> = scored.iter().enumerate().map(row).collect();
        let ceiling = ceiling.and_then(|_| rows.pop());
        Group { name: name.to_owned(), rows, ceiling }
    };
    match grouping {
        // The paper's tables hold rooms of 3D-FRONT alone.
        Grouping::Dataset if protocol == "paper" && kinds(results).len() > 1 => kinds(results)
            .into_iter()
            .map(|(kind, scenes)| group(title(kind), &|_, scores| of_scenes(scores, &scenes)))
            .collect(),
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

/// The scenes of each kind of source.
fn kinds(results: &[ResultFile]) -> BTreeMap<SourceKind, Vec<SceneId>> {
    let mut kinds: BTreeMap<SourceKind, Vec<SceneId>> = BTreeMap::new();
    for (scene, kind) in results.iter().flat_map(|result| &result.dataset.sources) {
        let scenes = kinds.entry(*kind).or_default();
        if !scenes.contains(scene) {
            scenes.push(scene.clone());
        }
    }
    kinds
}

fn title(kind: SourceKind) -> &'static str {
    match kind {
        SourceKind::Front3d => "3D-FRONT",
        SourceKind::Bitterli => "Bitterli",
        SourceKind::Gltf => "glTF",
        SourceKind::Blend => "Blender",
    }
}

/// Means over some of the scenes; the noise of different scenes is independent.
fn of_scenes(scores: &ProtocolResult, scenes: &[SceneId]) -> BTreeMap<CellKey, Value> {
    let mut all: BTreeMap<CellKey, Vec<Value>> = BTreeMap::new();
    for (key, value) in scenes.iter().flat_map(|scene| of_scene(scores, scene)) {
        all.entry(key).or_default().push(value);
    }
    let mean = |values: Vec<Value>| {
        let count = values.len() as f64;
        let squares: Option<f64> = values.iter().map(|value| value.standard_error.map(|error| error * error)).sum();
        Value {
            value: values.iter().map(|value| value.value).sum::<f64>() / count,
            standard_error: squares.map(|squares| squares.sqrt() / count),
        }
    };
    all.into_iter().map(|(key, values)| (key, mean(values))).collect()
}

fn of_dataset(scores: &ProtocolResult) -> BTreeMap<CellKey, Value> {
    let value = |(key, value): (&ResultKey, &f64)| {
        let standard_error = scores.summary_noise.get(key).copied();
        (CellKey::from(*key), Value { value: *value, standard_error })
    };
    scores.summary.iter().map(value).collect()
}

fn of_scene(scores: &ProtocolResult, scene: &SceneId) -> BTreeMap<CellKey, Value> {
    let noise = scores.noise.get(scene);
    let value = |(key, value): (&ResultKey, &f64)| {
        let standard_error = noise.and_then(|noise| noise.get(key)).copied();
        (CellKey::from(*key), Value { value: *value, standard_error })
    };
    scores.scenes.get(scene).into_iter().flatten().map(value).collect()
}
