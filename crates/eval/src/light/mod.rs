//! Submissions compared with a scene's truth under light.
//!
//! The truth under light is R, the scorer's own render of the true maps: [`mod@reference`] makes it, once a scene. The true
//! maps also travel along the paths of every prediction (`paths`), so that what few paths miss or exaggerate of both cancels:
//! [`mod@difference`] turns a prediction's four quarters into two estimates of its encoded difference from R, which are exactly
//! zero for the true maps. `own` does so in every lighting, and `score` takes their metrics over the regions of every view; the
//! noise of an error is that of [`error`], over the [`blocks`] of pixels that share paths. [`lighting`] says which lights burn,
//! [`rules`] what of all this a protocol states. Protocol `paper` compares with the photo's renderer instead: [`fitted`].

pub mod blocks;
pub mod difference;
pub mod error;
pub mod fitted;
pub mod lighting;
pub(crate) mod lit_picture;
pub(crate) mod own;
pub(crate) mod paths;
pub mod reference;
pub mod rules;
pub(crate) mod score;
pub mod true_maps;
