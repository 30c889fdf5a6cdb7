//! Reads 3D-FRONT: houses as JSON in three releases, their furniture from 3D-FUTURE, and their textures.
//!
//! The inputs are the path of a house and the folders of models and textures. The output is a [`FurnishedHouse`] in
//! world space, and a [`SourceScene`](crate::source_scene::SourceScene) for one of its rooms and the views of a camera.
//! The data has many faults and most of its keys are optional, so everything that is missing or repaired is a finding
//! with its JSON pointer. An error means that the file is not a house.
//!
//! The steps:
//! - `document` parses the JSON within limits; `house` and `house_mesh` turn it into a [`House`] with its designers'
//!   cameras;
//! - [`furnish()`] places everything: `model` reads the furniture without painted shadows, `material_class` finds the
//!   classes of material, `appearance` makes materials and textures;
//! - the caller builds one [`World`](mateval_tracer::World) from the house's scene;
//! - [`camera_sampler`] draws cameras in it that keep [`camera_rules`];
//! - [`room_scene`] selects one room, what its views see of the other rooms, and its lights.

mod appearance;
pub mod camera_rules;
pub mod camera_sampler;
mod document;
mod furnish;
mod house;
mod house_mesh;
mod material_class;
mod model;
pub mod room_scene;
#[cfg(test)]
mod tests;

pub use document::Limits;
pub use furnish::{FurnishedHouse, HouseFiles, PlacedModel, PlacedSurface, furnish, read_house};
pub use house::{DesignerCamera, House, Room};
pub use material_class::{AppearanceRule, class_named, finish_of};
