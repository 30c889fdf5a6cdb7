//! From submissions to scores: what must be trusted.
//!
//! In: a dataset with its ground truth, a submission, the weights of LPIPS. Out: [`result::ResultFile`], or with
//! [`verify`] whether a result says what the submission scores.
//!
//! Between: [`protocol`] holds every constant, [`material_pictures`] makes pictures of a submission's maps, [`alignment`]
//! takes out the scale, [`predicted_light`] renders the maps under every light, [`measure`] compares, [`texture_space`]
//! compares texel by texel, [`score`] goes through the dataset.

pub mod alignment;
pub mod error;
pub mod fixed_rules;
pub mod instance_errors;
pub mod light_rules;
pub mod light_score;
pub mod lit_scene;
pub mod mask_rule;
pub mod material_pictures;
mod material_score;
pub mod means;
pub mod measure;
pub mod metric;
pub mod noise_blocks;
pub mod open_scene;
pub mod pilot;
pub mod predicted_light;
pub mod protocol;
pub mod relit;
pub mod result;
pub mod result_key;
mod result_writer;
pub mod rgb;
mod scene_order;
mod scene_score;
mod scene_scorer;
pub mod score;
mod seeds;
pub mod shown_scene;
pub mod texture_space;
pub mod truth;
pub mod truth_material;
pub mod verify;
pub mod word_enum;

pub use error::EvalError;
