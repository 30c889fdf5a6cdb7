//! Makes a dataset from source scenes, and examines finished ones.
//!
//! The inputs are a recipe and the folders that it names, which hold files of the sources that [`mateval_sources`]
//! reads. The output is a dataset's folder as `dataset_spec/format` describes it.
//!
//! The steps: [`recipe`] reads and checks the whole recipe. [`build`] then makes scene by scene: it reads the source by
//! [`mateval_sources`], gives it other materials where the recipe has it redressed (`redress`), numbers instances and
//! parts, makes the pictures of the [`views`], unwraps the instances by [`atlas`] and bakes their materials, which
//! [`conversion`] brings to the scored model. [`render`] adds the RGB truth, with Blender ([`blender_job`]) where that is
//! the renderer. [`scene_meshes`] compares a finished scene with its meshes. [`survey`] lists the rooms that a recipe
//! could name. [`perturb`] copies what methods see, with other geometry.
//!
//! Of a finished dataset, [`verify`] finds the faults, [`compare`] states how far Blender's pictures agree with those of
//! the built-in tracer, and [`stats`] counts what it contains.

pub mod atlas;
pub mod blender_job;
pub mod build;
pub mod compare;
pub mod conversion;
pub mod error;
pub mod perturb;
pub mod recipe;
mod redress;
pub mod render;
pub mod scene_meshes;
pub mod stats;
pub mod survey;
pub mod verify;
pub mod views;

pub use error::PrepError;
