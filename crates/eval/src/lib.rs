//! Scores of submissions: the part of MatEval that must be trusted.
//!
//! In: a dataset with its ground truth, a submission, the weights of LPIPS. Out: [`result::ResultFile`], or, from [`verify`],
//! whether a result states what the submission scores.
//!
//! [`protocol`] holds the constants that protocols may change, [`fixed_rules`] those that they may not. For each scene of
//! the dataset, [`score()`](score::score) reads the submissions' maps
//! ([`read_scene`](mateval_submission::prediction::read_scene)), and `scene_score` takes three steps:
//!
//! 1. `material_score` looks up the maps in every view ([`material_pictures`]), removes their scale ([`alignment`]) and
//!    compares the pictures with the truth's ([`measure`]).
//! 2. [`light`] renders the maps under every light and compares the renders with the scorer's own render of the true maps.
//! 3. `material_score` compares the maps texel by texel ([`texture_space`]).
//!
//! A [`result`] lists every value by scene, view and picture, with its key ([`result_key`]), and their means ([`means`]):
//! pictures to scenes, scenes to the dataset.

pub mod alignment;
pub mod error;
pub mod fixed_rules;
pub mod light;
pub mod mask_rule;
pub mod material_pictures;
mod material_score;
pub mod means;
pub mod measure;
pub mod metric;
pub mod open_scene;
pub mod pictures_dir;
pub mod protocol;
pub mod result;
pub mod result_key;
mod scene_score;
mod scene_task;
pub mod score;
pub mod shown_scene;
pub mod texture_space;
pub mod truth;
pub mod verify;
pub mod word_enum;

pub use error::EvalError;
