//! Makes a dataset from source scenes.
//!
//! The inputs are a recipe and the folders that it names, which hold files of the sources that [`mateval_sources`] reads.
//! The output is a dataset's folder as `dataset_spec/FORMAT.md` describes it.
//!
//! The steps: [`recipe`] reads and checks the whole recipe. [`build`] then makes scene by scene with [`build_scene`]:
//! [`mateval_sources`] reads the source, [`instances`] numbers its surfaces, [`part_split`] and [`part_labels`] split them
//! into parts, [`atlas`] unwraps them, [`bake`] fills their textures, and [`views`] makes the pictures. [`render`] adds the
//! RGB truth. [`survey`] lists the rooms that a recipe could name. [`perturb`] copies what methods see, with other
//! geometry.

pub mod atlas;
pub mod bake;
pub mod blender;
pub mod bring_up_to_date;
pub mod build;
pub mod build_scene;
pub mod conversion;
pub mod error;
pub mod faults;
pub mod finish;
pub mod instances;
pub mod numbering;
pub mod part_labels;
pub mod part_split;
pub mod perturb;
mod preview;
pub mod recipe;
pub mod render;
pub mod scene_meshes;
pub mod survey;
pub mod views;

pub use error::PrepError;
