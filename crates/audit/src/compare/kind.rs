//! What surfaces are made of, as far as two renderers may differ about it.

use mateval_scene::material::MaterialModel;
use mateval_scene::reference::ReferenceScene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A kind of material. The first two mean the same to both renderers; the others are the nearest that Blender has, in the
/// order of how far that is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaterialKind {
    /// Diffuse.
    Lambert,
    /// Blender's own.
    Principled,
    /// Diffuse and rough: there are several of that name.
    OrenNayar,
    /// A metal.
    Conductor,
    /// A clear coat over a diffuse ground.
    Plastic,
    /// Glass, thin or not.
    Dielectric,
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
        }
    }

    /// Of every surface of the scene.
    pub fn of_surfaces(scene: &ReferenceScene) -> Vec<Self> {
        scene.surfaces.iter().map(|surface| Self::of(&scene.materials[surface.material.0].model)).collect()
    }

    /// Whether both renderers mean the same by it, so that a tile that shows no other kind decides.
    pub fn decides(self) -> bool {
        self <= Self::Principled
    }

    /// As JSON has it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Lambert => "lambert",
            Self::Principled => "principled",
            Self::OrenNayar => "oren_nayar",
            Self::Conductor => "conductor",
            Self::Plastic => "plastic",
            Self::Dielectric => "dielectric",
        }
    }
}
