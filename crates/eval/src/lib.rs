//! Scores of submissions: the part of MatEval that must be trusted.
//!
//! In: a dataset with its ground truth, a submission, the weights of LPIPS. Out: [`result::ResultFile`], or, from
//! [`verify`], whether a result states what the submission scores.
//!
//! [`metric`] is the table of metrics; [`protocol`] holds the constants that protocols may change, [`fixed_rules`]
//! those that they may not. For each [`scene`] of the dataset ([`truth::OpenScene`]), [`score()`](score::score) reads
//! the submissions' maps ([`read_scene`](mateval_submission::prediction::read_scene)) and takes three steps:
//!
//! 1. [`materials::score`] looks up the maps in every view ([`materials::pictures`]) and compares the pictures with the
//!    [`truth`]'s, base colour also without its scale.
//! 2. [`light`] renders the maps under every light and compares the renders with R, the scorer's own render of the true
//!    maps ([`light::reference`]). The true maps travel along the paths of every prediction that is not a copy of the truth
//!    ([`light::own_lights`]), so that noise common to both cancels. [`light::difference`] turns four quarters into two
//!    estimates of the encoded difference from R, exactly zero for the true maps; [`light::mse`] states their noise,
//!    and `light::score` makes PSNRs of both. Protocol `paper` compares with the photo's renderer instead
//!    ([`light::fitted_lights`]).
//! 3. [`materials::texels`] compares the maps texel by texel.
//!
//! Of a scene with twins, [`constancy`] then compares the maps of scene and twins with each other.
//!
//! A captured scene has no true maps: [`materials::measured`] compares means over regions with measured colours, and
//! renders under fitted lights are compared with its photos.
//!
//! A [`result`] lists every value by scene, view and picture, with its key ([`result::key`]), and their means
//! ([`result::means()`]) with their errors: pictures to scenes, scenes to the dataset. [`shown`] has the pictures
//! behind the numbers.

pub mod constancy;
pub mod error;
pub mod fixed_rules;
pub mod metric;
mod pictures_dir;
pub mod protocol;
pub mod result;
pub mod scene;
pub mod score;
pub mod shown;
pub mod truth;
pub mod verify;

pub mod materials {
    //! Submissions' maps compared with the true ones, or with measured colours, without light.
    pub mod measured;
    pub mod pictures;
    pub mod score;
    pub mod texels;
}

pub mod light {
    //! Submissions under light.
    pub mod difference;
    pub mod fitted_lights;
    pub mod mse;
    pub mod own_lights;
    pub mod reference;
    pub(crate) mod score;
    pub(crate) mod shared_paths;
}

pub use error::EvalError;
