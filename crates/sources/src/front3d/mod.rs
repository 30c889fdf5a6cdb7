//! Reads 3D-FRONT: houses as JSON in three releases, their furniture from 3D-FUTURE, and their textures.
//!
//! The inputs are the path of a house and the folders of models and textures. The output is a [`FurnishedHouse`] in world
//! space, and a [`SourceScene`](crate::source_scene::SourceScene) for one of its rooms and the views of a camera. The data
//! has many faults and most of its keys are optional, so everything that is missing or repaired is a finding with its JSON
//! pointer. An error means that the file is not a house.
//!
//! The steps:
//! - `document` parses the JSON within limits; `house_reader` and `house_mesh` turn it into a [`House`];
//! - [`furnish()`] places everything with `furnisher`, `model`, `model_info` and `appearance`; `drop_shadow` finds
//!   painted shadows, `classify` the classes of material by `class_table`, `finish` lays them out over a surface;
//!   `coincident` moves apart the `sheets` that coincide; `cameras` adds the designers' cameras;
//! - the caller builds one [`World`](mateval_tracer::World) from the house's scene;
//! - [`camera_sampler`] draws cameras in it that keep [`camera_rules`];
//! - [`room_scene`] selects one room and what its views see of the other rooms, and `lights` adds the lights.

mod appearance;
mod appearance_rule;
pub mod camera_rules;
pub mod camera_sampler;
mod cameras;
mod class_table;
mod classify;
mod document;
mod drop_shadow;
mod error;
mod finish;
mod furnish;
mod furnished_house;
mod furnisher;
mod house;
mod house_files;
mod house_mesh;
mod house_reader;
mod lights;
mod limits;
mod model;
mod model_info;
pub mod room_scene;

pub use appearance_rule::AppearanceRule;
pub use error::HouseError;
pub use furnish::{furnish, read_house};
pub use furnished_house::{FurnishedHouse, PlacedModel, PlacedSurface};
pub use house::{
    Child, ChildKind, DesignerCamera, FurnitureRecord, House, HouseMaterial, HouseMesh, Placement, Release, Room,
};
pub use house_files::HouseFiles;
pub use limits::Limits;

#[cfg(test)]
pub(crate) mod tests;
#[cfg(test)]
mod tests_real;
