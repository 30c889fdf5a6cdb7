//! The files that are given for a release's report, each of which must be about its dataset.
//!
//! These are the verdicts of `prep compare`, whether two renderers agree on a scene; and the results that give the
//! ceiling and the floor, the scores of the truth itself and of a constant estimate.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::{DatasetError, Finding, SceneId, Severity, json};
use mateval_eval::result::key::ResultKey;
use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_files::FileError;
use mateval_prep::compare::file::{COMPARE_FORMAT, CompareFile, SceneComparison, State};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Mismatch, ReportError, fitting};
use crate::ranking::{basis, inexact_light};

/// Whether two renderers agree on a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneVerdict {
    /// The program that compared and its version.
    pub tool: String,
    /// Whether every check that could be decided agrees, and every picture could be read.
    pub agrees: bool,
    /// The number of checks in each state that occurs.
    pub checks: Vec<StateCount>,
    /// One line for every check that does not agree or decides nothing; null where the ground truth is withheld, since
    /// the lines state measurements of it.
    pub faults: Option<Vec<String>>,
}

/// The number of checks in one state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StateCount {
    /// The state.
    pub state: State,
    /// The number of checks.
    pub checks: usize,
}

impl SceneVerdict {
    fn new(file: &CompareFile, scene: &SceneComparison) -> Self {
        let checks = || scene.views.iter().flat_map(|view| view.checks.iter().map(move |check| (&view.view, check)));
        let count = |state: State| StateCount { state, checks: checks().filter(|(_, c)| c.state == state).count() };
        let faults = checks().filter(|(_, check)| check.state != State::Agrees);
        Self {
            tool: file.tool.clone(),
            agrees: agrees(scene),
            checks: State::ALL.map(count).into_iter().filter(|count| count.checks > 0).collect(),
            faults: Some(faults.map(|(view, check)| format!("{view}: {check}")).collect()),
        }
    }

    pub fn total(&self) -> usize {
        self.checks.iter().map(|count| count.checks).sum()
    }

    /// The number of checks that decide nothing.
    pub fn undecided(&self) -> usize {
        self.checks.iter().filter(|count| count.state.is_open()).map(|count| count.checks).sum()
    }
}

fn agrees(scene: &SceneComparison) -> bool {
    let mut checks = scene.views.iter().flat_map(|view| &view.checks).peekable();
    checks.peek().is_some() && !checks.any(|check| check.state.is_fault())
}

/// Reads verdicts from files, and from the `.json` files of folders and of the folders directly below. Fails with every
/// reason for which one of them does not fit: it is something else, is about another dataset or a part of a scene, or
/// repeats a scene.
pub fn read_comparisons(paths: &[PathBuf], dataset: &Dataset) -> Result<BTreeMap<SceneId, SceneVerdict>, ReportError> {
    let mut findings = Vec::new();
    let mut verdicts: BTreeMap<SceneId, (PathBuf, SceneVerdict)> = BTreeMap::new();
    for path in json_files(paths)? {
        let read = json::read_format::<CompareFile>(&path, COMPARE_FORMAT);
        let Some(file) = fitting(read, "a comparison", &path, ACTION, &mut findings)? else { continue };
        if let Some(finding) = foreign(&path, &file.dataset.manifest_sha256, dataset) {
            findings.push(finding);
            continue;
        }
        findings.extend(contradiction(&path, &file));
        for (at, scene) in file.scenes.iter().enumerate() {
            findings.extend(incomplete(&path, at, scene, dataset));
            if let Some((earlier, _)) = verdicts.get(&scene.scene) {
                let message = format!("'{}' holds the scene '{}' too", earlier.display(), scene.scene);
                findings.push(unfit(&path, &format!("/scenes/{at}/scene"), message));
            }
            verdicts.insert(scene.scene.clone(), (path.clone(), SceneVerdict::new(&file, scene)));
        }
    }
    if !findings.is_empty() {
        return Err(ReportError::UnfitForRelease(findings));
    }
    Ok(verdicts.into_iter().map(|(scene, (_, verdict))| (scene, verdict)).collect())
}

/// A finding if the file's verdict does not follow from its checks.
fn contradiction(path: &Path, file: &CompareFile) -> Option<Finding> {
    let found = file.scenes.iter().all(agrees);
    let message = || format!("states {}, but its checks give {found}", file.agrees);
    (file.agrees != found).then(|| unfit(path, "/agrees", message()))
}

/// A finding if the dataset has no such scene, or if not each of its views was compared.
fn incomplete(path: &Path, at: usize, found: &SceneComparison, dataset: &Dataset) -> Option<Finding> {
    let scene: Option<&SceneFile> = dataset.scenes.iter().find(|scene| scene.id == found.scene);
    let Some(scene) = scene else {
        let message = format!("the dataset has no scene '{}'", found.scene);
        return Some(unfit(path, &format!("/scenes/{at}/scene"), message));
    };
    let is_same = scene.views.iter().map(|view| &view.id).eq(found.views.iter().map(|view| &view.view));
    let message = || format!("these are not the {} views of the scene '{}'", scene.views.len(), scene.id);
    (!is_same).then(|| unfit(path, &format!("/scenes/{at}/views"), message()))
}

/// The files, sorted within each folder.
fn json_files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, ReportError> {
    let mut all = Vec::new();
    for path in paths {
        if !path.is_dir() {
            all.push(path.clone());
            continue;
        }
        let mut found = Vec::new();
        for entry in entries(path)? {
            match entry.is_dir() {
                true => found.extend(entries(&entry)?.into_iter().filter(|file| is_json(file))),
                false => found.extend(Some(entry).filter(|file| is_json(file))),
            }
        }
        if found.is_empty() {
            return Err(ReportError::NoVerdicts { folder: path.clone() });
        }
        all.extend(found);
    }
    Ok(all)
}

fn is_json(path: &Path) -> bool {
    path.is_file() && path.extension().is_some_and(|extension| extension == "json")
}

/// The entries of a folder, sorted.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let io = || FileError::io("list", folder);
    let entries = std::fs::read_dir(folder).map_err(io())?;
    let mut paths: Vec<PathBuf> =
        entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>().map_err(io())?;
    paths.sort();
    Ok(paths)
}

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

    /// The scores of one scene; absent if it was not scored, or the ground truth is withheld.
    pub fn of_scene(&self, scene: &SceneId) -> Option<&BTreeMap<ResultKey, f64>> {
        self.scenes.as_ref()?.get(scene)
    }
}

#[derive(Clone, Debug, Default)]
pub struct Bounds {
    /// The scores of the truth.
    pub ceiling: Option<ReferenceScores>,
    /// The scores of a constant estimate.
    pub floor: Option<ReferenceScores>,
}

/// Reads the results of the ceiling and the floor under the protocol. Fails with every reason for which one of them
/// does not fit: it is something else, was made on another dataset, contradicts its own numbers or its fingerprint, or
/// has no scores under the protocol; or both depend on different rules.
pub fn read_bounds(
    ceiling: Option<&Path>,
    floor: Option<&Path>,
    protocol: &str,
    dataset: &Dataset,
) -> Result<Bounds, ReportError> {
    let mut findings = Vec::new();
    let [first, second] = [ceiling, floor].map(|path| path.map(|path| result(path, protocol, dataset, &mut findings)));
    let (first, second) = (first.transpose()?.flatten(), second.transpose()?.flatten());
    if let (Some(first), Some((result, scores)), Some(path)) = (&first, &second, floor)
        && basis(&first.0, &first.1, &[]) != basis(result, scores, &[])
    {
        let message = "its rules, scorer or LPIPS weights are not those of the ceiling".to_owned();
        findings.push(unfit(path, &format!("/protocols/{protocol}/fingerprint"), message));
    }
    if let (Some((result, scores)), Some(path)) = (&first, ceiling)
        && let Some((key, value)) = inexact_light(scores)
    {
        let message = Mismatch::Ceiling { method: result.shown_method(), key: *key, value }.to_string();
        findings.push(unfit(path, &format!("/protocols/{protocol}/summary/{key}"), message));
    }
    if !findings.is_empty() {
        return Err(ReportError::UnfitForRelease(findings));
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
) -> Result<Option<Scored>, ReportError> {
    let Some(mut result) = fitting(ResultFile::read(path), "a result", path, ACTION, findings)? else {
        return Ok(None);
    };
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

/// What to do with a file that does not fit.
const ACTION: &str = "make it again from this dataset, or leave it out";

/// A finding about the place, a JSON pointer, of a file.
fn unfit(path: &Path, place: &str, message: String) -> Finding {
    Finding::new(Severity::Error, "unfit_file", path.display().to_string(), place, message, ACTION)
}

/// A finding if the file is about another dataset than this one; `manifest` is the hash that it states.
pub(crate) fn foreign(path: &Path, manifest: &str, dataset: &Dataset) -> Option<Finding> {
    let ours = &dataset.file.manifest_sha256;
    let message = || {
        let found = mateval_files::untrusted::shortened(manifest);
        format!("it is about the dataset with manifest '{found}', and this one has '{ours}'")
    };
    (manifest != ours).then(|| unfit(path, "/dataset/manifest_sha256", message()))
}
