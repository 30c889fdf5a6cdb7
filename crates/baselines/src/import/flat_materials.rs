//! `<scene>.json`: one uniform material per part or instance.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mateval_scene::{PartSetId, json};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{ImportError, MaterialFault};
use crate::error::BaselineError;
use crate::estimate::{GivenMaps, Values};
use crate::geometry::SceneGeometry;
use crate::median::DEFAULT;
use crate::part_colors::PartColors;
use crate::part_triangles::PartTriangles;

/// A uniform material.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlatMaterial {
    /// Linear base colour, 0 to 1.
    pub base_color: [f32; 3],
    /// Perceptual roughness, 0 to 1.
    #[serde(default)]
    pub roughness: Option<f32>,
    /// Metallic, 0 to 1.
    #[serde(default)]
    pub metallic: Option<f32>,
}

/// Materials by the id of a part, or of an instance, which stands for all its parts without an entry of their own.
pub type FlatMaterials = BTreeMap<String, FlatMaterial>;

impl FlatMaterial {
    fn values(&self) -> Values {
        let [r, g, b] = self.base_color;
        [r, g, b, self.roughness.unwrap_or(DEFAULT[3]), self.metallic.unwrap_or(DEFAULT[4])]
    }

    fn is_in_range(&self) -> bool {
        let numbers = self.base_color.iter().chain(&self.roughness).chain(&self.metallic);
        numbers.into_iter().all(|v| (0.0..=1.0).contains(v))
    }
}

/// Reads the file. The error lists every wrong entry.
pub fn read<'a>(
    path: &Path,
    geometry: &SceneGeometry<'a>,
    set: Option<&PartSetId>,
) -> Result<(PartColors<'a>, GivenMaps), BaselineError> {
    let materials: FlatMaterials = json::read(path)?;
    let triangles = PartTriangles::read(geometry, set)?;
    let parts = triangles.parts;
    let instances = geometry.scene.instances.iter().map(|instance| instance.id.as_str());
    let known: BTreeSet<&str> = parts.iter().map(|part| part.id.as_str()).chain(instances).collect();
    let unknown = materials.keys().filter(|id| !known.contains(id.as_str()));
    let unknown = unknown.map(|id| MaterialFault::UnknownId(id.clone()));
    let out_of_range = materials.iter().filter(|(_, material)| !material.is_in_range());
    let out_of_range = out_of_range.map(|(id, _)| MaterialFault::OutOfRange(id.clone()));
    let faults: Vec<MaterialFault> = unknown.chain(out_of_range).collect();
    if !faults.is_empty() {
        return Err(BaselineError::BadImport { path: path.to_owned(), source: ImportError::Materials(faults) });
    }
    let colors = PartColors::new(triangles, |part, instance| {
        let own = materials.get(parts[part].id.as_str());
        let material = own.or_else(|| materials.get(geometry.scene.instances[instance].id.as_str()));
        material.map(FlatMaterial::values)
    });
    let any = |has: fn(&FlatMaterial) -> bool| materials.values().any(has);
    let given = GivenMaps {
        base_color: true,
        roughness: any(|m| m.roughness.is_some()),
        metallic: any(|m| m.metallic.is_some()),
    };
    Ok((colors, given))
}
