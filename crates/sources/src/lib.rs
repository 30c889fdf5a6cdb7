//! Files from elsewhere become source scenes.
//!
//! In: a 3D-FRONT house with its furniture, or a Mitsuba scene of Bitterli's resources. Out: a
//! [`source_scene::SourceScene`] a room or scene: geometry in world space, materials, lights, a camera, and findings about
//! everything that was wrong with the input. All input is untrusted: sizes are limited before memory is taken, and no file
//! outside the source's folder is opened.
//!
//! Between: [`bitterli`] reads XML, [`front3d`] reads a house's JSON, furnishes its rooms and draws cameras; [`log`]
//! collects findings, [`surface_mesh`] repairs meshes and takes them to world space, [`parts`] splits them.

pub mod below;
pub mod bitterli;
pub mod error;
pub mod front3d;
pub mod log;
pub mod npy;
pub mod parts;
pub mod source_scene;
pub mod surface_mesh;

pub use error::SourceError;
