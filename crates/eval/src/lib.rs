//! From submissions to scores.
//!
//! In: a dataset with its ground truth, a submission folder, the weights of LPIPS. Out: [`result::ResultFile`], and
//! tables of several.
//!
//! Between: [`protocol`] holds every constant, [`prediction`] reads the submission's maps, [`albedo`] makes pictures of
//! them, [`alignment`] takes out the scale, [`light_fit`] lights the scene as the photo is lit, [`measure`] compares,
//! [`score`] goes through the dataset, [`tables`] shows.

pub mod albedo;
pub mod alignment;
pub mod error;
pub mod light_fit;
pub mod measure;
pub mod pair;
pub mod prediction;
pub mod protocol;
pub mod result;
pub mod score;
pub mod strips;
pub mod tables;

pub use error::EvalError;
