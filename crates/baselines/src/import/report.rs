//! What came of an import.

use mateval_scene::{InstanceId, SceneId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The word for this version of a report.
pub const IMPORT_FORMAT: &str = "mateval-import/1";

/// How well each instance's surface was found in the files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImportReport {
    /// Always `mateval-import/1`.
    pub format: String,
    /// Places further away than this do not correspond.
    pub max_distance_m: f64,
    /// Meshes, JSON and folders that are for no scene or instance, by their paths below the folder; sorted.
    pub unused: Vec<String>,
    /// In the dataset's order.
    pub scenes: Vec<ImportedScene>,
}

/// One scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImportedScene {
    /// Its id.
    pub scene: SceneId,
    /// Every instance that has an atlas.
    pub instances: Vec<ImportedInstance>,
}

/// One instance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImportedInstance {
    /// Its id.
    pub instance: InstanceId,
    /// The file that tells of it, relative to the folder; null: none does. Where all texels found nothing it has no
    /// maps.
    pub file: Option<String>,
    /// Texels that the surface looks up.
    pub texels: usize,
    /// Those of them that found nothing; they hold the format's defaults.
    pub texels_without: usize,
    /// How near the file's mesh comes to it, in metres; null without a mesh.
    pub nearest_m: Option<f64>,
    /// Of the places that were found, in metres; null without any.
    pub mean_distance_m: Option<f64>,
    /// The furthest of them.
    pub max_distance_m: Option<f64>,
}

impl ImportedInstance {
    /// Whether anything was found.
    pub fn has_maps(&self) -> bool {
        self.texels > self.texels_without
    }
}

impl ImportedScene {
    /// Sums over its instances: how many have maps; texels of those, and those without; the mean of their mean
    /// distances by texels, and the largest of all.
    pub fn totals(&self) -> ImportTotals {
        let with_maps = || self.instances.iter().filter(|instance| instance.has_maps());
        let found = |instance: &ImportedInstance| instance.texels - instance.texels_without;
        let texels = with_maps().map(|instance| instance.texels).sum();
        let all_found: usize = with_maps().map(found).sum();
        let weighted = |instance: &ImportedInstance| Some(instance.mean_distance_m? * found(instance) as f64);
        let sum: f64 = with_maps().filter_map(weighted).sum();
        ImportTotals {
            with_maps: with_maps().count(),
            texels,
            texels_without: texels - all_found,
            mean_distance_m: (all_found > 0).then(|| sum / all_found as f64),
            max_distance_m: with_maps().filter_map(|instance| instance.max_distance_m).reduce(f64::max),
        }
    }
}

/// See [`ImportedScene::totals`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportTotals {
    /// Instances with maps.
    pub with_maps: usize,
    /// Their texels.
    pub texels: usize,
    /// Those that found nothing.
    pub texels_without: usize,
    /// Over the texels that found something.
    pub mean_distance_m: Option<f64>,
    /// The furthest.
    pub max_distance_m: Option<f64>,
}
