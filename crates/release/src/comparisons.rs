//! The verdicts of `prep compare`, read from its files: whether two renderers agree on a scene.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_audit::compare::file::{COMPARE_FORMAT, CompareFile, SceneComparison, State};
use mateval_scene::dataset::SceneFile;
use mateval_scene::open::Dataset;
use mateval_scene::{Finding, SceneError, SceneId, json};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReleaseError;
use crate::unfit::{fitting, foreign, unfit};

/// All states, in the order in which they are counted.
const STATES: [State; 6] =
    [State::Agrees, State::Differs, State::TooNoisy, State::Undecided, State::Missing, State::Unreadable];

/// Whether two renderers agree on a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneVerdict {
    /// The program that compared and its version.
    pub tool: String,
    /// Whether every check of every view agrees.
    pub agrees: bool,
    /// The number of checks in each state that occurs.
    pub checks: Vec<StateCount>,
    /// One line for every check that does not agree; null where the ground truth is withheld, since the lines state
    /// measurements of it.
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
            checks: STATES.map(count).into_iter().filter(|count| count.checks > 0).collect(),
            faults: Some(faults.map(|(view, check)| format!("{view}: {check}")).collect()),
        }
    }

    /// The number of all checks.
    pub fn total(&self) -> usize {
        self.checks.iter().map(|count| count.checks).sum()
    }
}

fn agrees(scene: &SceneComparison) -> bool {
    let mut checks = scene.views.iter().flat_map(|view| &view.checks).peekable();
    checks.peek().is_some() && checks.all(|check| check.state == State::Agrees)
}

/// Reads verdicts from files, and from the `.json` files of folders and of the folders directly below. Fails with every
/// reason for which one of them does not fit: it is something else, is about another dataset or a part of a scene, or
/// repeats a scene.
pub fn read(paths: &[PathBuf], dataset: &Dataset) -> Result<BTreeMap<SceneId, SceneVerdict>, ReleaseError> {
    let mut findings = Vec::new();
    let mut verdicts: BTreeMap<SceneId, (PathBuf, SceneVerdict)> = BTreeMap::new();
    for path in files(paths)? {
        let read = json::read_format::<CompareFile>(&path, COMPARE_FORMAT);
        let Some(file) = fitting(read, "a comparison", &path, &mut findings)? else { continue };
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
        return Err(ReleaseError::UnfitFiles(findings));
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
fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, ReleaseError> {
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
            return Err(ReleaseError::NoVerdicts { folder: path.clone() });
        }
        all.extend(found);
    }
    Ok(all)
}

fn is_json(path: &Path) -> bool {
    path.is_file() && path.extension().is_some_and(|extension| extension == "json")
}

/// The entries of a folder, sorted.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, SceneError> {
    let io = || SceneError::io("list", folder);
    let entries = std::fs::read_dir(folder).map_err(io())?;
    let mut paths: Vec<PathBuf> =
        entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>().map_err(io())?;
    paths.sort();
    Ok(paths)
}
