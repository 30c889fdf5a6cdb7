//! Which results can be ranked together, and on which scenes.

use std::collections::{BTreeMap, BTreeSet};

use mateval_scene::SceneId;
use mateval_scene::submission::Map;

use crate::error::ReportError;
use crate::mismatch::Mismatch;
use mateval_eval::result::{ProtocolResult, ResultFile};

/// One result's scores under the protocol.
pub(super) struct Entrant<'a> {
    pub(super) result: &'a ResultFile,
    pub(super) scores: &'a ProtocolResult,
    /// Scenes for which the submission has no base colour.
    pub(super) left_out: BTreeSet<SceneId>,
}

impl<'a> Entrant<'a> {
    fn new(result: &'a ResultFile, scores: &'a ProtocolResult) -> Self {
        Self { result, scores, left_out: left_out(result, scores) }
    }

    fn name(&self) -> String {
        self.result.shown_method()
    }

    /// The fingerprint that it would have if these scenes had been scored; without scenes, a hash of everything else
    /// that scores depend on.
    fn basis(&self, scenes: &[&SceneId]) -> String {
        let weights = self.result.lpips_weights.get(&self.scores.protocol.fixed.lpips_net).and_then(Option::as_deref);
        let dataset = &self.result.dataset;
        self.scores.protocol.fingerprint(&dataset.manifest_sha256, scenes, weights)
    }
}

/// Results that can be ranked together.
pub(super) struct Board<'a> {
    pub(super) entrants: Vec<Entrant<'a>>,
    /// The scenes that any result covers, in the dataset's order.
    pub(super) scenes: Vec<SceneId>,
    pub(super) houses: BTreeMap<SceneId, String>,
    pub(super) fingerprint: String,
}

/// Gathers results under one protocol. Fails with every reason for which they cannot be ranked together; results that
/// lack scenes are accepted only if `partial`.
pub(super) fn board<'a>(results: &'a [ResultFile], protocol: &str, partial: bool) -> Result<Board<'a>, ReportError> {
    if results.is_empty() {
        return Err(ReportError::NoResults);
    }
    let mut mismatches: Vec<Mismatch> =
        results.iter().filter_map(|result| Mismatch::of_result(result, protocol)).collect();
    let is_readable = |result: &&ResultFile| Mismatch::of_result(result, protocol).is_none();
    let entrant = |result: &'a ResultFile| Some(Entrant::new(result, result.protocols.get(protocol)?));
    let entrants: Vec<Entrant<'a>> = results.iter().filter(is_readable).filter_map(entrant).collect();
    mismatches.extend(entrants.iter().filter_map(own_fault));
    mismatches.extend(entrants.iter().skip(1).filter_map(|entrant| mixed(&entrants[0], entrant)));
    let scenes = scenes_of_any(&entrants);
    if !partial {
        mismatches.extend(entrants.iter().filter_map(|entrant| too_few_scenes(entrant, &scenes)));
    }
    ReportError::refuse(mismatches)?;
    let houses = entrants.iter().flat_map(|entrant| entrant.result.dataset.houses.clone()).collect();
    let fingerprint = entrants[0].basis(&scenes.iter().collect::<Vec<_>>());
    Ok(Board { entrants, scenes, houses, fingerprint })
}

/// What is wrong with one result by itself: it contradicts its fingerprint, or holds impossible scores or scenes.
fn own_fault(entrant: &Entrant<'_>) -> Option<Mismatch> {
    changed(entrant).or_else(|| impossible_score(entrant)).or_else(|| faulty_scene(entrant))
}

fn changed(entrant: &Entrant<'_>) -> Option<Mismatch> {
    let found = entrant.basis(&entrant.result.dataset.scenes.iter().collect::<Vec<_>>());
    let stated = &entrant.scores.fingerprint;
    (found != *stated).then(|| Mismatch::Changed { method: entrant.name(), stated: stated.clone(), found })
}

/// Scores are bounded, so that no sum of them is infinite.
fn impossible_score(entrant: &Entrant<'_>) -> Option<Mismatch> {
    let is_possible = |value: f64| value.abs() < 1e12;
    let (key, value) = entrant.scores.scenes.values().flatten().find(|(_, value)| !is_possible(**value))?;
    Some(Mismatch::ImpossibleScore { method: entrant.name(), key: *key, value: *value })
}

fn faulty_scene(entrant: &Entrant<'_>) -> Option<Mismatch> {
    let dataset = &entrant.result.dataset;
    if dataset.scenes.iter().collect::<BTreeSet<_>>().len() < dataset.scenes.len() {
        return Some(Mismatch::RepeatedScene { method: entrant.name() });
    }
    let scene = dataset.scenes.iter().find(|scene| !dataset.houses.contains_key(*scene))?;
    Some(Mismatch::NoHouse { method: entrant.name(), scene: scene.clone() })
}

fn mixed(first: &Entrant<'_>, other: &Entrant<'_>) -> Option<Mismatch> {
    if first.basis(&[]) != other.basis(&[]) {
        return Some(Mismatch::Fingerprints { first: first.name(), other: other.name() });
    }
    let houses = &other.result.dataset.houses;
    let mut known = first.result.dataset.houses.iter();
    let (scene, _) = known.find(|(scene, house)| houses.get(*scene).is_some_and(|other| other != *house))?;
    Some(Mismatch::Houses { first: first.name(), other: other.name(), scene: scene.clone() })
}

fn too_few_scenes(entrant: &Entrant<'_>, scenes: &[SceneId]) -> Option<Mismatch> {
    let (scored, scenes) = (entrant.result.dataset.scenes.len(), scenes.len());
    (scored < scenes).then(|| Mismatch::TooFewScenes { method: entrant.name(), scored, scenes })
}

/// The scenes of the result that covers most of them, in the dataset's order, then those that it lacks, by name.
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
