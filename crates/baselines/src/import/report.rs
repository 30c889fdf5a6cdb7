//! The report of an import: how much of each instance's surface the files cover.

use mateval_scene::{InstanceId, SceneId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The value of `format` for this version of the report.
pub const IMPORT_FORMAT: &str = "mateval-import/1";

/// How much of each instance's surface the files cover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImportReport {
    /// Always `mateval-import/1`.
    pub format: String,
    /// Largest distance, in metres, between a place of an instance and the place of the mesh that its material is taken
    /// from.
    pub max_distance_m: f64,
    /// Meshes, JSON files and folders whose names match no scene or instance: paths below the folder, sorted.
    pub unused: Vec<String>,
    /// The scenes, in the dataset's order.
    pub scenes: Vec<ImportedScene>,
}

/// One scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImportedScene {
    /// The scene's id.
    pub scene: SceneId,
    /// Every instance that has an atlas.
    pub instances: Vec<ImportedInstance>,
}

/// One instance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImportedInstance {
    /// The instance's id.
    pub instance: InstanceId,
    /// The file that describes the instance, relative to the folder; null if none does. An instance has no maps where
    /// `texels_without` equals `texels`.
    pub file: Option<String>,
    /// Number of texels that the surface uses.
    pub texels: usize,
    /// Number of those texels that found no place of the mesh near enough; they have the format's default values.
    pub texels_without: usize,
    /// Smallest distance between the instance and the file's mesh, in metres; null without a mesh.
    pub nearest_m: Option<f64>,
    /// Mean distance of the places that were found, in metres; null without any.
    pub mean_distance_m: Option<f64>,
    /// Largest distance of the places that were found, in metres; null without any.
    pub max_distance_m: Option<f64>,
}

impl ImportedInstance {
    /// Whether at least one texel found a place of the mesh.
    pub fn has_maps(&self) -> bool {
        self.texels > self.texels_without
    }
}

impl ImportedScene {
    /// Totals over the scene's instances.
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

/// Totals of a scene. Texels and distances count instances with maps only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportTotals {
    /// Number of instances with maps.
    pub with_maps: usize,
    /// Number of their texels.
    pub texels: usize,
    /// Number of those texels that found no place.
    pub texels_without: usize,
    /// Mean of the instances' mean distances, weighted by the texels that found a place, in metres.
    pub mean_distance_m: Option<f64>,
    /// Largest distance, in metres.
    pub max_distance_m: Option<f64>,
}
