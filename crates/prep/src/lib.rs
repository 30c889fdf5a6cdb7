//! From source scenes to a dataset.
//!
//! In: a recipe and the folders that it names (rooms of 3D-FRONT, Mitsuba scenes of Bitterli's resources). Out: a dataset folder as
//! `dataset_spec/FORMAT.md` tells, or findings about one.
//!
//! Between: [`recipe`] is checked whole, [`front3d`] or [`bitterli`] reads each source, [`instances`] numbers, [`atlas`] unwraps, [`bake`]
//! fills textures, [`views`] makes the pictures, [`build`] writes scene by scene, [`render`] adds the RGB truth,
//! [`compare`] holds another renderer's against it, [`verify`] doubts it all, [`stats`] counts it.

pub mod atlas;
pub mod bake;
pub mod bitterli;
pub mod blender;
pub mod build;
pub mod build_scene;
pub mod compare;
pub mod error;
pub mod front3d;
pub mod instances;
pub mod mitsuba_export;
pub(crate) mod part_labels;
pub mod part_split;
pub mod parts;
pub mod publish;
pub mod recipe;
pub mod render;
pub mod sample;
pub mod source;
pub mod stats;
pub mod survey;
pub mod verify;
pub mod views;

pub use error::PrepError;
