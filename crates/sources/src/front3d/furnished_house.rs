//! A house in world space with its furniture.

use std::sync::Arc;

use glam::DVec3;
use mateval_scene::Finding;
use mateval_scene::reference::ReferenceScene;

use super::appearance_rule::AppearanceRule;
use super::house::{DesignerCamera, House};
use crate::source_scene::InstanceOrigin;

/// The model of a piece of furniture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlacedModel {
    /// The model's id.
    pub jid: String,
    /// The name that BlenderProc would give the piece, in lower case: category, else title.
    pub name: String,
    /// Whether both model and texture could be read.
    pub complete: bool,
}

/// Facts about a surface of the house besides its mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedSurface {
    /// Index in [`House::rooms`].
    pub room: usize,
    /// Role, categories and parts of its instance.
    pub origin: InstanceOrigin,
    /// The model of a piece of furniture; none for architecture.
    pub model: Option<PlacedModel>,
    /// Linear colour, in which a ceiling emits.
    pub color: [f32; 3],
}

/// A house with its furniture, without lights.
#[derive(Clone, Debug)]
pub struct FurnishedHouse {
    /// The content of the JSON.
    pub house: House,
    /// The house's file, as findings name it.
    pub file: String,
    /// All surfaces, room by room, without lights. It is shared with the [`World`](mateval_tracer::World) made of it.
    pub scene: Arc<ReferenceScene>,
    /// Where the roughness and metallic of its materials come from.
    pub appearance: AppearanceRule,
    /// Facts about each surface, in the order of `scene.surfaces`.
    pub placed: Vec<PlacedSurface>,
    /// What has been subtracted from all positions in world space, in metres.
    pub shift_m: DVec3,
    /// Designers' cameras by number, from the file beside the house or else from the JSON.
    pub cameras: Vec<DesignerCamera>,
    /// For each room the number of valid pieces that its children refer to, whether they could be placed or not.
    pub wanted_pieces: Vec<usize>,
    /// Faults of the input; sorted.
    pub findings: Vec<Finding>,
    /// Every file that was read, relative to the root, and its SHA-256; sorted.
    pub files: Vec<(String, String)>,
    /// Every file that was looked for but is missing; sorted.
    pub absent: Vec<String>,
}
