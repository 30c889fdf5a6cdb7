//! The report of an import, `IMPORT.json`: how much of each instance was covered, and how its files were placed.

use mateval_dataset::material::MaterialParameter;
use mateval_dataset::{InstanceId, SceneId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::files::FlatMaterial;

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
    /// Whether the file describes this instance alone, and not the whole scene.
    #[serde(default)]
    pub own_file: bool,
    /// Where the file's mesh lies; null without a mesh.
    #[serde(default)]
    pub frame: Option<ImportedFrame>,
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
    /// Mean of the texels that found a place: linear base colour, roughness and metallic; null without any.
    #[serde(default)]
    pub mean: Option<FlatMaterial>,
    /// What materials of the file do not state. Roughness and metallic that no material states are not submitted.
    #[serde(default)]
    pub unstated: Vec<MaterialParameter>,
    /// Faces of the file that have textures and no texture coordinates; they have the mean of the texture.
    #[serde(default)]
    pub faces_without_uv: usize,
}

/// Where a mesh lies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "state", rename_all = "snake_case", deny_unknown_fields)]
pub enum ImportedFrame {
    /// In the dataset's world space, where it belongs.
    InPlace,
    /// Elsewhere. A place `p` of it was used as `scale * rotation * p + shift_m`, which lies on the surfaces that it
    /// belongs to.
    Moved {
        /// Metres for one unit of the mesh.
        scale: f64,
        /// Rows of an orthogonal matrix; a mirror if its determinant is -1.
        rotation: [[f64; 3]; 3],
        /// In metres.
        shift_m: [f64; 3],
        /// Root mean square distance that remains between the surfaces, in metres.
        residual_m: f64,
        /// Largest residual that is accepted, in metres.
        limit_m: f64,
        /// Number of other turns that fit as well, because the mesh is symmetric.
        other_turns: usize,
    },
    /// No similarity brings it to the surfaces that it belongs to. It is used as it is: it may be a part of them.
    Unexplained {
        /// Smallest residual of those that were tried, in metres; null if no box has the right proportions.
        best_residual_m: Option<f64>,
        /// Largest residual that is accepted, in metres.
        limit_m: f64,
    },
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
    pub texels: usize,
    /// Number of those texels that found no place.
    pub texels_without: usize,
    /// Mean of the instances' mean distances, weighted by the texels that found a place, in metres.
    pub mean_distance_m: Option<f64>,
    /// Largest distance, in metres.
    pub max_distance_m: Option<f64>,
}
