//! The dataset, and those of its scenes, that a result or a lint report is about.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::dataset::{SceneFile, WideView};
use crate::open::Dataset;
use crate::{RendererId, SceneId, SourceKind, ViewId};

/// The dataset and the scenes that were scored or checked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// The kind of source of each scored scene. Tables of protocol `paper` keep them apart.
    #[serde(default)]
    pub sources: BTreeMap<SceneId, SourceKind>,
    /// The views from other places than the input view's, by scene.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub wide_views: BTreeMap<SceneId, BTreeMap<ViewId, WideView>>,
    /// The renderer that made the input pictures; null where none made all of them.
    #[serde(default)]
    pub photo_renderer: Option<RendererId>,
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
            sources: scenes.iter().map(|scene| (scene.id.clone(), scene.source.kind)).collect(),
            wide_views: scenes.iter().filter_map(|scene| Some((scene.id.clone(), wide_views(scene)?))).collect(),
            photo_renderer: dataset.file.photo_renderer.clone(),
        }
    }
}

/// The wide views of a scene; none if it has none.
fn wide_views(scene: &SceneFile) -> Option<BTreeMap<ViewId, WideView>> {
    let found: BTreeMap<ViewId, WideView> =
        scene.views.iter().filter_map(|view| Some((view.id.clone(), view.wide?))).collect();
    (!found.is_empty()).then_some(found)
}
