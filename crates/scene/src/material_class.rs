//! The classes of material from which a source's reader draws roughness and metallic, and the file that lists them.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ids::PartId;

/// A class of material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaterialClass {
    /// Clear or tinted glass, as the glossy surface of a dielectric.
    Glass,
    /// Bare metal.
    Metal,
    /// Polished stone.
    Stone,
    /// Glazed tiles and ceramics.
    Tile,
    /// Leather with a gloss.
    SmoothLeather,
    /// Other leather.
    Leather,
    /// Suede and velvet.
    Suede,
    /// Bamboo and rattan.
    Wicker,
    /// Coarse cloth, wool and carpets.
    CoarseCloth,
    /// Cotton and other cloth.
    Cloth,
    /// Wall paint, plaster and wallpaper.
    Paint,
    /// Painted or lacquered woodwork.
    Lacquer,
    /// Boards with faces of melamine.
    Board,
    /// Varnished or oiled wood.
    Wood,
    /// Plastic.
    Plastic,
}

impl MaterialClass {
    /// Every class.
    pub const ALL: [Self; 15] = [
        Self::Glass,
        Self::Metal,
        Self::Stone,
        Self::Tile,
        Self::SmoothLeather,
        Self::Leather,
        Self::Suede,
        Self::Wicker,
        Self::CoarseCloth,
        Self::Cloth,
        Self::Paint,
        Self::Lacquer,
        Self::Board,
        Self::Wood,
        Self::Plastic,
    ];
}

/// The word that JSON files use.
impl fmt::Display for MaterialClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// `ground_truth/material_classes.json`: the class of each of the source's own parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialClassesFile {
    /// Always `mateval/3`.
    pub format: String,
    /// In the order of `parts` of `scene.json`.
    pub parts: Vec<ClassifiedPart>,
}

/// The class of a part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClassifiedPart {
    /// The part.
    pub part: PartId,
    /// Its class; null where its triangles belong to several.
    pub class: Option<MaterialClass>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_class_prints_as_in_json() {
        for class in MaterialClass::ALL {
            assert_eq!(serde_json::to_value(class).unwrap(), class.to_string());
        }
        assert_eq!(MaterialClass::SmoothLeather.to_string(), "smooth_leather");
    }
}
