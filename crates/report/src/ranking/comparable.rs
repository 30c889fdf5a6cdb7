//! Which results may be ranked together, and on which scenes.

use std::collections::{BTreeMap, BTreeSet};

use mateval_scene::SceneId;
use mateval_scene::submission::Map;

use crate::error::ReportError;
use mateval_eval::result::{ProtocolResult, RESULT_FORMAT, ResultFile};

/// One result's scores under the protocol.
pub(super) struct Entrant<'a> {
    pub(super) result: &'a ResultFile,
    pub(super) scores: &'a ProtocolResult,
    /// Scenes of which the submission has no base colour at all.
    pub(super) left_out: BTreeSet<SceneId>,
}

impl<'a> Entrant<'a> {
    fn new(result: &'a ResultFile, scores: &'a ProtocolResult) -> Self {
        Self { result, scores, left_out: left_out(result, scores) }
    }

    /// What its fingerprint would be if these scenes had been scored; of none of them: all else that numbers depend on.
    fn basis(&self, scenes: &[&SceneId]) -> String {
        let weights = self.result.lpips_weights.get(&self.scores.protocol.lpips_net).and_then(Option::as_deref);
        let dataset = &self.result.dataset;
        let renderer = dataset.scored_renderer.as_ref();
        self.scores.protocol.fingerprint(&dataset.manifest_sha256, scenes, renderer, weights)
    }
}

/// What may be ranked together.
pub(super) struct Board<'a> {
    pub(super) entrants: Vec<Entrant<'a>>,
    /// That any result covers, in the dataset's order.
    pub(super) scenes: Vec<SceneId>,
    pub(super) houses: BTreeMap<SceneId, String>,
    pub(super) fingerprint: String,
}

/// Fails with everything that keeps the results apart. Those of fewer scenes are let in where `partial`.
pub(super) fn board<'a>(results: &'a [ResultFile], protocol: &str, partial: bool) -> Result<Board<'a>, ReportError> {
    let mut faults = Vec::new();
    let mut entrants = Vec::new();
    for result in results {
        if result.format != RESULT_FORMAT {
            let (method, format) = (&result.method, &result.format);
            faults.push(format!("'{method}' is of format '{format}'; this version reads '{RESULT_FORMAT}'"));
        } else if let Some(scores) = result.protocols.get(protocol) {
            entrants.push(Entrant::new(result, scores));
        } else {
            let method = &result.method;
            faults.push(format!(
                "'{method}' has no scores under protocol '{protocol}'; score it with --protocol {protocol}"
            ));
        }
    }
    if results.is_empty() {
        faults.push("no result to rank".to_owned());
    }
    faults.extend(entrants.iter().filter_map(own_fault));
    faults.extend(entrants.iter().skip(1).filter_map(|entrant| mixed(&entrants[0], entrant)));
    let scenes = scenes_of_any(&entrants);
    if !partial {
        faults.extend(entrants.iter().filter_map(|entrant| too_few_scenes(entrant, &scenes)));
    }
    if !faults.is_empty() {
        return Err(ReportError::Invalid(faults.join("; ")));
    }
    let houses = entrants.iter().flat_map(|entrant| entrant.result.dataset.houses.clone()).collect();
    let fingerprint = entrants[0].basis(&scenes.iter().collect::<Vec<_>>());
    Ok(Board { entrants, scenes, houses, fingerprint })
}

/// A result must be what its fingerprint says, hold scores, and tell the houses of its scenes.
fn own_fault(entrant: &Entrant<'_>) -> Option<String> {
    changed(entrant).or_else(|| odd_score(entrant)).or_else(|| odd_scene(entrant))
}

fn changed(entrant: &Entrant<'_>) -> Option<String> {
    let found = entrant.basis(&entrant.result.dataset.scenes.iter().collect::<Vec<_>>());
    (found != entrant.scores.fingerprint).then(|| {
        format!(
            "'{}' says fingerprint {}, but its protocol, dataset, scenes and weights have {found}: it has been \
             changed; score it again",
            entrant.result.method, entrant.scores.fingerprint
        )
    })
}

/// No score is so large that a sum of them could be infinite.
fn odd_score(entrant: &Entrant<'_>) -> Option<String> {
    let is_score = |value: f64| value.abs() < 1e12;
    let (key, value) = entrant.scores.scenes.values().flatten().find(|(_, value)| !is_score(**value))?;
    Some(format!("'{}' holds '{key}' of {value:e}, which is no score; score it again", entrant.result.method))
}

fn odd_scene(entrant: &Entrant<'_>) -> Option<String> {
    let (method, dataset) = (&entrant.result.method, &entrant.result.dataset);
    if dataset.scenes.iter().collect::<BTreeSet<_>>().len() < dataset.scenes.len() {
        return Some(format!("'{method}' lists a scene twice; score it again"));
    }
    let unknown = dataset.scenes.iter().find(|scene| !dataset.houses.contains_key(*scene))?;
    Some(format!("'{method}' does not say of which house scene '{unknown}' is; score it again with this version"))
}

fn mixed(first: &Entrant<'_>, other: &Entrant<'_>) -> Option<String> {
    let names = format!("'{}' and '{}'", first.result.method, other.result.method);
    if first.basis(&[]) != other.basis(&[]) {
        return Some(format!(
            "{names} have different fingerprints: dataset, protocol, scorer or LPIPS weights are not the same; \
             score both again with one"
        ));
    }
    let houses = &other.result.dataset.houses;
    let mut known = first.result.dataset.houses.iter();
    let (scene, _) = known.find(|(scene, house)| houses.get(*scene).is_some_and(|other| other != *house))?;
    Some(format!("{names} put scene '{scene}' into different houses: one of them has been changed; score it again"))
}

fn too_few_scenes(entrant: &Entrant<'_>, scenes: &[SceneId]) -> Option<String> {
    let scored = entrant.result.dataset.scenes.len();
    (scored < scenes.len()).then(|| {
        format!(
            "'{}' was scored on {scored} of {} scenes; score it on all, or add --partial to rank it on these",
            entrant.result.method,
            scenes.len()
        )
    })
}

/// Every result has its scenes in the dataset's order; those that the longest lacks follow in the order of their names.
fn scenes_of_any(entrants: &[Entrant<'_>]) -> Vec<SceneId> {
    let longest = entrants.iter().map(|entrant| &entrant.result.dataset.scenes).max_by_key(|scenes| scenes.len());
    let mut scenes = longest.cloned().unwrap_or_default();
    let rest: BTreeSet<&SceneId> = entrants.iter().flat_map(|entrant| &entrant.result.dataset.scenes).collect();
    scenes.extend(rest.into_iter().filter(|scene| !scenes.contains(scene)).cloned().collect::<Vec<_>>());
    scenes
}

/// Scenes all of whose base colours are missing.
fn left_out(result: &ResultFile, scores: &ProtocolResult) -> BTreeSet<SceneId> {
    let mut instances: BTreeMap<&str, usize> = BTreeMap::new();
    for texels in &scores.texels {
        *instances.entry(texels.scene.as_str()).or_default() += 1;
    }
    let mut missing: BTreeMap<&str, usize> = BTreeMap::new();
    for finding in result.findings.iter().filter(|finding| finding.code == "missing_map") {
        let mut parts = finding.file.split('/').skip(1);
        let (scene, map) = (parts.next(), parts.nth(1));
        if let Some(scene) = scene.filter(|_| map.is_some_and(|map| map.starts_with(Map::BaseColor.stem()))) {
            *missing.entry(scene).or_default() += 1;
        }
    }
    let is_out =
        |scene: &&SceneId| instances.get(scene.as_str()).is_some_and(|n| missing.get(scene.as_str()) == Some(n));
    result.dataset.scenes.iter().filter(is_out).cloned().collect()
}
