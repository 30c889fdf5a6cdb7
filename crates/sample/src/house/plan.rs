//! A house as data, from which its files follow: rooms with their meshes, furniture and cameras, and the materials,
//! textures and models that they name.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec2;

use super::architecture::ArchitectureMesh;
use super::materials::{ArchitectureMaterial, ArchitectureTexture};
use super::models::Model;

pub struct House {
    pub rooms: Vec<Room>,
    /// The materials that the rooms' meshes name. A material's id follows from its position.
    pub materials: Vec<ArchitectureMaterial>,
    pub textures: Vec<ArchitectureTexture>,
    /// The library of models, which the rooms' furniture names.
    pub models: Vec<Model>,
}

/// A rectangular room between two corners (x, z).
pub struct Room {
    /// The data's type of room.
    pub kind: &'static str,
    /// The data's instanceid.
    pub name: &'static str,
    pub low: DVec2,
    pub high: DVec2,
    pub meshes: Vec<ArchitectureMesh>,
    pub furniture: Vec<Furniture>,
    pub cameras: Vec<Snapshot>,
}

/// A record of the `furniture` list, and where its model is placed.
pub struct Furniture {
    /// The record's id.
    pub uid: &'static str,
    /// The name of its model.
    pub model: &'static str,
    /// As in "sofa/l-shaped sofa"; may be empty.
    pub title: &'static str,
    /// A position in metres and a rotation for each piece.
    pub pieces: Vec<([f64; 3], Turn)>,
}

impl Furniture {
    /// A record whose model is placed once.
    pub fn new(uid: &'static str, model: &'static str, title: &'static str, at: [f64; 3], turn: Turn) -> Self {
        Self { uid, model, title, pieces: vec![(at, turn)] }
    }
}

/// A rotation about y as a quaternion in the data's order x, y, z, w.
pub type Turn = [f64; 4];

/// Rotations by the direction that the front faces. A model's own front faces +z, which is south.
pub const SOUTH: Turn = [0.0, 0.0, 0.0, 1.0];
pub const EAST: Turn = [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];
pub const NORTH: Turn = [0.0, 1.0, 0.0, 0.0];
pub const WEST: Turn = [0.0, -FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];

/// A designer's camera.
pub struct Snapshot {
    /// Position and target in metres.
    pub at: [f64; 3],
    pub target: [f64; 3],
    /// Vertical field of view in degrees.
    pub fov_y_deg: f64,
}

impl Snapshot {
    pub fn new(at: [f64; 3], target: [f64; 3], fov_y_deg: f64) -> Self {
        Self { at, target, fov_y_deg }
    }
}

impl House {
    /// The model with this name.
    pub fn model(&self, name: &str) -> &Model {
        self.models.iter().find(|model| model.name == name).expect("furniture names models of the library")
    }

    /// The least and the greatest corner (x, z) of the rooms' inner outlines.
    pub fn outline(&self) -> [DVec2; 2] {
        let grown = |[low, high]: [DVec2; 2], room: &Room| [low.min(room.low), high.max(room.high)];
        self.rooms.iter().fold([DVec2::MAX, DVec2::MIN], grown)
    }
}
