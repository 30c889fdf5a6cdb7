//! The ceiling and the floor of a release: the scores of the truth itself and of a constant estimate, read from results.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_eval::EvalError;
use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_eval::result_key::ResultKey;
use mateval_scene::open::Dataset;
use mateval_scene::{Finding, SceneId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReleaseError;
use crate::unfit::{fitting, foreign, unfit};

/// The scores of one submission.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceScores {
    /// The program that scored and its version.
    pub tool: String,
    /// The name of the submission, as it states it.
    pub method: String,
    /// The description of the submission, as it states it.
    pub description: String,
    /// The protocol.
    pub protocol: String,
    /// The version of the scorer.
    pub scorer_version: u32,
    /// The hash of everything that the scores depend on.
    pub fingerprint: String,
    /// Number of scenes that were scored.
    pub scenes_scored: usize,
    /// Means over these scenes.
    pub summary: BTreeMap<ResultKey, f64>,
    /// Standard errors of the means of PSNR of light due to render noise, in dB.
    pub summary_noise: BTreeMap<ResultKey, f64>,
    /// The scores of each scene; null where the ground truth is withheld.
    pub scenes: Option<BTreeMap<SceneId, BTreeMap<ResultKey, f64>>>,
    /// Standard errors of the PSNR of light of each scene, in dB; null where the ground truth is withheld.
    pub noise: Option<BTreeMap<SceneId, BTreeMap<ResultKey, f64>>>,
}

impl ReferenceScores {
    fn new(result: &ResultFile, scores: &ProtocolResult) -> Self {
        Self {
            tool: result.tool.clone(),
            method: result.method.clone(),
            description: result.submission.description.clone(),
            protocol: scores.protocol.name.clone(),
            scorer_version: scores.protocol.scorer_version,
            fingerprint: scores.fingerprint.clone(),
            scenes_scored: result.dataset.scenes.len(),
            summary: scores.summary.clone(),
            summary_noise: scores.summary_noise.clone(),
            scenes: Some(scores.scenes.clone()),
            noise: Some(scores.noise.clone()),
        }
    }

    /// The scores of one scene; none where it was not scored, or the ground truth is withheld.
    pub fn of_scene(&self, scene: &SceneId) -> Option<&BTreeMap<ResultKey, f64>> {
        self.scenes.as_ref()?.get(scene)
    }
}

/// The ceiling and the floor.
#[derive(Clone, Debug, Default)]
pub struct Bounds {
    /// The scores of the truth.
    pub ceiling: Option<ReferenceScores>,
    /// The scores of a constant estimate.
    pub floor: Option<ReferenceScores>,
}

/// Reads the results of the ceiling and the floor under the protocol. Fails with every reason for which one of them does not
/// fit: it is something else, was made on another dataset, contradicts its own numbers or its fingerprint, or has no scores
/// under the protocol; or both depend on different rules.
pub fn read(
    ceiling: Option<&Path>,
    floor: Option<&Path>,
    protocol: &str,
    dataset: &Dataset,
) -> Result<Bounds, ReleaseError> {
    let mut findings = Vec::new();
    let [first, second] = [ceiling, floor].map(|path| path.map(|path| result(path, protocol, dataset, &mut findings)));
    let (first, second) = (first.transpose()?.flatten(), second.transpose()?.flatten());
    if let (Some(first), Some((result, scores)), Some(path)) = (&first, &second, floor)
        && basis(&first.0, &first.1, &[]) != basis(result, scores, &[])
    {
        let message = "its rules, scorer or LPIPS weights are not those of the ceiling".to_owned();
        findings.push(unfit(path, &format!("/protocols/{protocol}/fingerprint"), message));
    }
    if !findings.is_empty() {
        return Err(ReleaseError::UnfitFiles(findings));
    }
    let scores = |read: Option<Scored>| read.map(|(result, scores)| ReferenceScores::new(&result, &scores));
    Ok(Bounds { ceiling: scores(first), floor: scores(second) })
}

/// A result and its scores under one protocol.
type Scored = (ResultFile, ProtocolResult);

fn result(
    path: &Path,
    protocol: &str,
    dataset: &Dataset,
    findings: &mut Vec<Finding>,
) -> Result<Option<Scored>, ReleaseError> {
    let read = match ResultFile::read(path) {
        Ok(result) => Ok(result),
        Err(EvalError::Dataset(error)) => Err(error),
        Err(EvalError::Contradiction { place, said, found, .. }) => {
            findings.push(unfit(path, &place, format!("it states {said}, but its own numbers give {found}")));
            return Ok(None);
        }
        Err(other) => return Err(other.into()),
    };
    let Some(mut result) = fitting(read, "a result", path, findings)? else { return Ok(None) };
    let before = findings.len();
    findings.extend(foreign(path, &result.dataset.manifest_sha256, dataset));
    findings.extend(unknown_scenes(path, &result, dataset));
    let scores = result.protocols.remove(protocol);
    match &scores {
        Some(scores) => findings.extend(changed(path, &result, protocol, scores)),
        None => {
            let others: Vec<&str> = result.protocols.keys().map(String::as_str).collect();
            let message = format!("has no scores under protocol '{protocol}', only under: {}", others.join(", "));
            findings.push(unfit(path, "/protocols", message));
        }
    }
    Ok(scores.filter(|_| findings.len() == before).map(|scores| (result, scores)))
}

/// A finding if the result lists no scene, or one that the dataset does not have or another renderer.
fn unknown_scenes(path: &Path, result: &ResultFile, dataset: &Dataset) -> Option<Finding> {
    let known = &dataset.file.scenes;
    if result.dataset.photo_renderer != dataset.file.photo_renderer {
        let message = "light was compared with the pictures of another renderer".to_owned();
        return Some(unfit(path, "/dataset/photo_renderer", message));
    }
    let scenes = &result.dataset.scenes;
    let is_part = known.iter().filter(|id| scenes.contains(id)).eq(scenes) && !scenes.is_empty();
    let message = || "these are not scenes of the dataset in its order".to_owned();
    (!is_part).then(|| unfit(path, "/dataset/scenes", message()))
}

/// A finding if the fingerprint does not follow from the rest of the result.
fn changed(path: &Path, result: &ResultFile, protocol: &str, scores: &ProtocolResult) -> Option<Finding> {
    let found = basis(result, scores, &result.dataset.scenes.iter().collect::<Vec<_>>());
    let place = format!("/protocols/{protocol}/fingerprint");
    let message = || format!("does not follow from protocol, dataset, scenes and weights, which give {found}");
    (found != scores.fingerprint).then(|| unfit(path, &place, message()))
}

/// The fingerprint for these scenes; without scenes, a hash of everything else that scores depend on.
fn basis(result: &ResultFile, scores: &ProtocolResult, scenes: &[&SceneId]) -> String {
    let weights = result.lpips_weights.get(&scores.protocol.fixed.lpips_net).and_then(Option::as_deref);
    scores.protocol.fingerprint(&result.dataset.manifest_sha256, scenes, weights)
}
