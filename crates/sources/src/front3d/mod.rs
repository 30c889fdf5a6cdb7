//! Reads 3D-FRONT: houses as JSON in three releases, their furniture from 3D-FUTURE, their textures.
//!
//! In: the path of a house and the folders of models and textures. Out: a [`FurnishedHouse`] in world space, and of one of
//! its rooms and a camera a [`crate::source_scene::SourceScene`]. The data is dirty and most of its keys are optional: whatever
//! is missing or mended is a finding with its JSON pointer; an error is left for what is no house at all.
//!
//! Between: `document` makes a tree of the JSON (bounded), `house_reader` with `house_mesh` a [`House`] of it; `model`,
//! `model_info` read 3D-FUTURE; [`furnish`] places everything, by `furnisher` and `appearance`; `cameras` are the designers', [`camera_sampler`] finds
//! others; `lights` lets ceilings and lamps glow; [`room_scene`] takes one room and what its views see of the others.

mod appearance;
pub mod camera_sampler;
mod cameras;
mod coincident;
mod document;
mod furnish;
mod furnisher;
mod house;
mod house_mesh;
mod house_reader;
mod lights;
mod limits;
mod model;
mod model_info;
pub mod room_scene;

pub use furnish::{FurnishedHouse, HouseFiles, Placed, Role, furnish, read_house};
pub use house::{
    Child, ChildKind, DesignerCamera, FurnitureRecord, House, HouseMaterial, HouseMesh, Placement, Release, Room,
};
pub use limits::Limits;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_real;
