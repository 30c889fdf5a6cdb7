//! The dataset, and those of its scenes, that a result or a lint report is about.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::dataset::SceneFile;
use crate::open::Dataset;
use crate::{RendererId, SceneId};

/// The dataset and the scenes that were scored or checked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DatasetId {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of its manifest, hex.
    pub manifest_sha256: String,
    /// The scenes that were scored, in the dataset's order.
    pub scenes: Vec<SceneId>,
    /// The number of scenes of the dataset.
    pub total_scenes: usize,
    /// The house of each scored scene. Rankings draw scenes of one house together.
    #[serde(default)]
    pub houses: BTreeMap<SceneId, String>,
    /// The renderer whose pictures were the reference for light; null without such pictures.
    #[serde(default)]
    pub scored_renderer: Option<RendererId>,
}

impl DatasetId {
    /// Describes a dataset of which `scenes` are scored or checked.
    pub fn new<'a>(dataset: &Dataset, scenes: impl IntoIterator<Item = &'a SceneFile>) -> Self {
        let scenes: Vec<&SceneFile> = scenes.into_iter().collect();
        Self {
            name: dataset.file.name.clone(),
            version: dataset.file.version.clone(),
            manifest_sha256: dataset.file.manifest_sha256.clone(),
            scenes: scenes.iter().map(|scene| scene.id.clone()).collect(),
            total_scenes: dataset.file.scenes.len(),
            houses: scenes.iter().map(|scene| (scene.id.clone(), scene.source.house.clone())).collect(),
            scored_renderer: dataset.file.scored_renderer.clone(),
        }
    }
}
