//! Scores of submissions: the part of MatEval that must be trusted.
//!
//! In: a dataset with its ground truth, a submission, the weights of LPIPS. Out: [`result::ResultFile`], or, from [`verify`],
//! whether a result states what the submission scores.
//!
//! [`protocol`] holds every constant. For each scene of the dataset, [`score`] looks up a submission's maps in every view
//! ([`material_pictures`]) and removes their scale ([`alignment`]), renders the maps under every light ([`predicted_light`]),
//! compares pictures ([`measure`], [`rgb`]) and texels ([`texture_space`]). Scores stay nested by scene, view and picture
//! until the result lists each by its key ([`result_key`]) and takes the means ([`means`]).

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
