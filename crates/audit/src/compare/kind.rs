//! The kinds of material, by how far two renderers may differ on them.

use mateval_scene::material::MaterialModel;
use mateval_scene::reference::ReferenceScene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A kind of material. The first two mean the same to both renderers. For the others Blender has only an approximation;
/// they are ordered by how far it is off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaterialKind {
    /// Diffuse.
    Lambert,
    /// Blender's own principled material.
    Principled,
    /// Rough diffuse: several formulas share that name.
    OrenNayar,
    /// A metal.
    Conductor,
    /// A clear coat over a diffuse base.
    Plastic,
    /// Glass, thin or not.
    Dielectric,
    /// Any other material.
    Other,
}

impl MaterialKind {
    /// The kind of a model.
    pub fn of(model: &MaterialModel) -> Self {
        match model {
            MaterialModel::Diffuse { alpha: None, .. } => Self::Lambert,
            MaterialModel::Diffuse { alpha: Some(_), .. } => Self::OrenNayar,
            MaterialModel::Principled { .. } => Self::Principled,
            MaterialModel::Conductor { .. } => Self::Conductor,
            MaterialModel::Plastic { .. } => Self::Plastic,
            MaterialModel::Dielectric { .. } | MaterialModel::ThinDielectric { .. } => Self::Dielectric,
            // A new material takes no part in the verdict until it is known how well Blender approximates it.
            #[allow(unreachable_patterns, reason = "no model is left today; a new one must not need a change here")]
            _ => Self::Other,
        }
    }

    /// The kind of every surface of the scene.
    pub fn of_surfaces(scene: &ReferenceScene) -> Vec<Self> {
        scene.surfaces.iter().map(|surface| Self::of(&scene.materials[surface.material.0].model)).collect()
    }

    /// Whether it means the same to both renderers, so that a tile that shows no other kind counts for the verdict.
    pub fn decides(self) -> bool {
        self <= Self::Principled
    }

    /// The word that stands for it in JSON.
    pub fn word(self) -> &'static str {
        match self {
            Self::Lambert => "lambert",
            Self::Principled => "principled",
            Self::OrenNayar => "oren_nayar",
            Self::Conductor => "conductor",
            Self::Plastic => "plastic",
            Self::Dielectric => "dielectric",
            Self::Other => "other",
        }
    }
}
