//! The inputs of a release: the recipe and the sources' files, by their hashes, and the licences that came with them.

use std::collections::BTreeMap;

use mateval_scene::SceneId;
use mateval_scene::dataset::{DatasetFile, SceneFile};
use mateval_scene::manifest::sha256_of_bytes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The source's files of one scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneInputs {
    /// Number of files.
    pub files: usize,
    /// SHA-256, in hexadecimal, of a line `<sha256>  <path>` for each of `source.files` in `scene.json`, in their order.
    pub sha256: String,
}

impl SceneInputs {
    pub(crate) fn of(scene: &SceneFile) -> Self {
        let files = &scene.source.files;
        let lines: String = files.iter().map(|file| format!("{}  {}\n", file.sha256, file.path)).collect();
        Self { files: files.len(), sha256: sha256_of_bytes(lines.as_bytes()) }
    }
}

/// A licence text and the scenes that it is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SharedLicence {
    /// Its file, relative to the source of the first of these scenes.
    pub file: String,
    /// The whole text.
    pub text: String,
    /// The scenes, in the dataset's order.
    pub scenes: Vec<SceneId>,
}

/// Every licence text once, in the order of the first scene of each.
pub(crate) fn licences(dataset: &DatasetFile) -> Vec<SharedLicence> {
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut all: Vec<SharedLicence> = Vec::new();
    for licence in &dataset.licences {
        let at = *places.entry(&licence.text).or_insert(all.len());
        if at == all.len() {
            all.push(SharedLicence { file: licence.file.clone(), text: licence.text.clone(), scenes: Vec::new() });
        }
        all[at].scenes.push(licence.scene.clone());
    }
    all
}

/// The scenes for which the dataset states no licence.
pub(crate) fn without_licence(dataset: &DatasetFile) -> Vec<SceneId> {
    let has = |id: &SceneId| dataset.licences.iter().any(|licence| licence.scene == *id);
    dataset.scenes.iter().filter(|id| !has(id)).cloned().collect()
}
