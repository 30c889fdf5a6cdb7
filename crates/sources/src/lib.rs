//! Reads scenes from other projects' files.
//!
//! The input is a 3D-FRONT house with its furniture, a Mitsuba scene of Bitterli's resources, a glTF, a `.blend` file,
//! or the scan, cameras and photos of a real room. The output is a [`source_scene::SourceScene`] for each room or scene:
//! geometry in world space, materials, lights, a camera, and findings about all faults of the input. Input is
//! untrusted: sizes are limited before memory is taken, and no file outside the source's folder is opened.
//!
//! [`bitterli`] reads XML. [`front3d`] reads a house's JSON, furnishes its rooms and draws cameras. [`gltf`] reads glTF
//! files of any tool, and [`blend`] has Blender make one of its own files. [`capture`] reads a real room. They begin with
//! `open`, which opens the main file, and share [`source_scene`], `log`, which collects findings, [`surface_mesh`], which
//! repairs meshes and splits them into parts, `primitives`, `uv` and `coincident`.

pub mod bitterli;
pub mod blend;
pub mod capture;
mod coincident;
pub mod front3d;
pub mod gltf;
mod log;
mod open;
mod primitives;
pub mod source_scene;
pub mod surface_mesh;
mod uv;

pub use open::SourceError;
