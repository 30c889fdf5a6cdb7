//! Reads scenes from other projects' files.
//!
//! The input is a 3D-FRONT house with its furniture, a Mitsuba scene of Bitterli's resources, or a glTF. The output is
//! a [`source_scene::SourceScene`] for each room or scene: geometry in world space, materials, lights, a camera, and
//! findings about all faults of the input. Input is untrusted: sizes are limited before memory is taken, and no file
//! outside the source's folder is opened.
//!
//! [`bitterli`] reads XML. [`front3d`] reads a house's JSON, furnishes its rooms and draws cameras. [`gltf`] reads glTF
//! files of any tool. All use [`log`], which collects findings, [`surface_mesh`], which repairs meshes and transforms
//! them to world space, and [`parts`], which splits them. [`npy`] and [`below`] read arrays and paths that a recipe
//! names.

pub mod below;
pub mod bitterli;
pub mod clearance;
mod coincident;
pub mod error;
#[cfg(test)]
mod fallbacks;
pub mod front3d;
pub mod gltf;
mod json_size;
mod licence;
pub mod log;
mod map_disc;
mod mean_color;
mod missing_uv;
pub mod npy;
pub mod parts;
mod sheets;
mod shift;
pub mod source_scene;
pub mod surface_mesh;
mod unique_names;

pub use error::{InvalidSource, SourceError};
