//! From submissions to scores.
//!
//! In: a dataset with its ground truth, a submission folder, the weights of LPIPS. Out: [`result::ResultFile`], and
//! tables of several, and of one scene where and how its albedo errs.
//!
//! Between: [`protocol`] holds every constant, [`prediction`] reads the submission's maps, [`material_pictures`] makes
//! pictures of them, [`alignment`] takes out the scale, [`light_fit`] lights the scene as the photo is lit, [`measure`] compares,
//! [`score`] goes through the dataset, [`tables`] and [`strips`] show, [`explain`] tells kinds of error apart,
//! [`ranking`] ranks, [`leaderboard`] makes a site of it.

pub mod alignment;
pub mod archive;
mod coverage;
pub mod error;
pub mod explain;
mod instance_errors;
pub mod leaderboard;
pub mod light_fit;
pub mod light_rules;
mod light_score;
pub mod light_stage;
pub mod lint;
pub mod map_file;
pub mod material_pictures;
pub mod measure;
pub mod metric_kind;
pub mod noise_blocks;
mod open_scene;
pub mod pair;
pub mod picture_set;
mod pilot;
pub mod predicted_light;
pub mod prediction;
pub mod protocol;
pub mod ranking;
pub mod relit;
pub mod result;
pub mod rgb;
mod scene_score;
pub mod score;
mod shown_scene;
pub mod strips;
pub mod tables;
pub mod texel_map;
pub mod texture_space;
pub mod truth;
pub mod truth_material;
pub mod verify;

pub use error::EvalError;
