//! Scores of submissions: the part of MatEval that must be trusted.
//!
//! In: a dataset with its ground truth, a submission, the weights of LPIPS. Out: [`result::ResultFile`], or, from [`verify`],
//! whether a result states what the submission scores.
//!
//! [`protocol`] holds the constants that protocols may change, [`fixed_rules`] those that they may not. For each scene of
//! the dataset, [`score()`](score::score) reads the submissions' maps
//! ([`read_scene`](mateval_submission::prediction::read_scene)), and `scene_scorer` takes three steps:
//!
//! 1. `material_score` looks up the maps in every view ([`material_pictures`]), removes their scale ([`alignment`]) and
//!    compares the pictures with the truth's ([`measure`]).
//! 2. It compares the maps texel by texel ([`texture_space`]).
//! 3. `light_score` renders the maps under every light (`predicted_light`) and compares the renders ([`rgb`]).
//!
//! [`dataset_companions`] makes the pictures with which the third step corrects render noise part of a dataset.
//!
//! Scores stay nested by scene, view and picture until `result_writer` lists each value by its key ([`result_key`]) and
//! takes the means ([`means`]): pictures to scenes, scenes to the dataset.

pub mod alignment;
mod batch_mixes;
pub mod companion_pictures;
mod companion_store;
mod companions;
pub mod control_variate;
pub mod dataset_companions;
pub mod error;
mod fitted_mixes;
pub mod fitted_radiances;
pub mod fixed_rules;
pub mod instance_errors;
mod light_pass;
pub mod light_rules;
mod light_score;
mod lit_scene;
pub mod mask_rule;
pub mod material_pictures;
mod material_score;
pub mod means;
pub mod measure;
pub mod metric;
pub mod noise_blocks;
pub mod open_scene;
pub mod pilot;
mod pilot_view;
mod predicted_light;
pub mod protocol;
mod reference_features;
pub mod relit;
pub mod rendered_view;
pub mod result;
pub mod result_key;
mod result_writer;
pub mod rgb;
mod scene_score;
mod scene_scorer;
mod scene_task;
pub mod score;
mod seeds;
pub mod shown_render;
pub mod shown_scene;
mod stored_light;
pub mod texture_space;
pub mod truth;
pub mod truth_material;
mod truth_noise;
#[cfg(test)]
mod unbiased_tests;
pub mod verify;
mod view_set;
pub mod word_enum;

pub use error::EvalError;
