//! `<scene>.json`: one material a part, or an instance.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mateval_scene::{PartSetId, json};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::BaselineError;
use crate::estimate::{Says, Values};
use crate::geometry::SceneGeometry;
use crate::median::DEFAULT;
use crate::part_colors::{PartColors, parts_of};

/// One material, the same everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlatMaterial {
    /// Linear, 0 to 1.
    pub base_color: [f32; 3],
    /// Perceptual, 0 to 1.
    #[serde(default)]
    pub roughness: Option<f32>,
    /// 0 to 1.
    #[serde(default)]
    pub metallic: Option<f32>,
}

/// By the id of a part, or of an instance: its parts that are not named themselves.
pub type FlatMaterials = BTreeMap<String, FlatMaterial>;

impl FlatMaterial {
    fn values(&self) -> Values {
        let [r, g, b] = self.base_color;
        [r, g, b, self.roughness.unwrap_or(DEFAULT[3]), self.metallic.unwrap_or(DEFAULT[4])]
    }

    fn is_sound(&self) -> bool {
        let numbers = self.base_color.iter().chain(&self.roughness).chain(&self.metallic);
        numbers.into_iter().all(|v| (0.0..=1.0).contains(v))
    }
}

/// Reads the file; all that is wrong with it at once.
pub fn read(
    path: &Path,
    geometry: &SceneGeometry<'_>,
    set: Option<&PartSetId>,
) -> Result<(PartColors, Says), BaselineError> {
    let materials: FlatMaterials = json::read(path)?;
    let parts = parts_of(geometry, set)?;
    let instances = geometry.scene.instances.iter().map(|instance| instance.id.as_str());
    let known: BTreeSet<&str> = parts.iter().map(|part| part.id.as_str()).chain(instances).collect();
    let unknown = materials.keys().filter(|id| !known.contains(id.as_str()));
    let unknown = unknown.map(|id| format!("/{id}: expected the id of a part or an instance"));
    let unsound = materials.iter().filter(|(_, material)| !material.is_sound());
    let unsound = unsound.map(|(id, _)| format!("/{id}: expected numbers from 0 to 1"));
    let wrong: Vec<String> = unknown.chain(unsound).collect();
    if !wrong.is_empty() {
        return Err(BaselineError::BadImport { path: path.to_owned(), what: wrong.join("; ") });
    }
    let colors = PartColors::new(geometry, set, |part, instance| {
        let own = materials.get(parts[part].id.as_str());
        let material = own.or_else(|| materials.get(geometry.scene.instances[instance].id.as_str()));
        material.map(FlatMaterial::values)
    })?;
    let any = |has: fn(&FlatMaterial) -> bool| materials.values().any(has);
    let says =
        Says { base_color: true, roughness: any(|m| m.roughness.is_some()), metallic: any(|m| m.metallic.is_some()) };
    Ok((colors, says))
}
