//! The source's own materials of a scene whose materials were converted.

use std::collections::BTreeMap;

use crate::material::{Material, TextureIndex};
use crate::reference::{ReferenceScene, SourceTexture};

/// The materials as the source states them, in the order of [`ReferenceScene::materials`], with textures of their own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceMaterials {
    /// The materials.
    pub materials: Vec<Material>,
    /// The textures that they refer to.
    pub textures: Vec<SourceTexture>,
}

impl SourceMaterials {
    /// The materials of `scene` and the textures that they use. Indices of textures out of range stay out of range.
    pub fn of(scene: &ReferenceScene) -> Self {
        let mut new_from_old = BTreeMap::new();
        let mut found = Self { materials: scene.materials.clone(), textures: Vec::new() };
        for index in found.materials.iter_mut().flat_map(Material::texture_indices_mut) {
            let Some(texture) = scene.textures.get(index.0) else {
                *index = TextureIndex(usize::MAX);
                continue;
            };
            *index = *new_from_old.entry(*index).or_insert_with(|| {
                found.textures.push(texture.clone());
                TextureIndex(found.textures.len() - 1)
            });
        }
        found
    }

    /// `converted` with these materials in place of its own.
    pub fn in_scene(&self, converted: &ReferenceScene) -> ReferenceScene {
        let offset = converted.textures.len();
        let mut materials = self.materials.clone();
        for index in materials.iter_mut().flat_map(Material::texture_indices_mut) {
            index.0 = index.0.saturating_add(offset);
        }
        let textures = converted.textures.iter().chain(&self.textures).cloned().collect();
        ReferenceScene { materials, textures, ..converted.clone() }
    }
}
