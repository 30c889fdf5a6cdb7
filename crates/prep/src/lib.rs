//! From source scenes to a dataset.
//!
//! In: a recipe and the folders that it names (rooms of 3D-FRONT, Mitsuba scenes of Bitterli's resources). Out: a dataset
//! folder as `dataset_spec/FORMAT.md` describes it.
//!
//! Between: [`recipe`] is checked whole, [`mateval_sources`] reads each source, [`instances`] numbers, [`atlas`] unwraps,
//! [`bake`] fills textures, [`views`] makes the pictures, [`build`] writes scene by scene, [`render`] adds the RGB truth.
//! [`survey`] lists the rooms that a recipe could name.

pub mod atlas;
pub mod bake;
pub mod blender;
pub mod build;
pub mod build_scene;
pub mod error;
pub mod faults;
pub mod instances;
pub(crate) mod part_labels;
pub mod part_split;
pub mod recipe;
pub mod render;
pub mod scene_meshes;
pub mod survey;
pub mod views;

pub use error::PrepError;
