//! Baselines: methods that come with the tool, and bridges to other projects.
//!
//! Input: a dataset, and for most baselines an [`estimate`] of the input view, which may come from another method's
//! pictures by way of an [`adapter`]. Output: a submission.
//!
//! Baselines: [`bounds`] are the ceiling for atlases of this size and the floor; [`nn`] lifts the estimate to the
//! atlases; [`median`] takes medians of it; [`procedural`] fits graphs to it; [`import`] transfers meshes that have their
//! own uv. [`delight`] makes an estimate by taking the light out of the photo. [`bridges`]: with TEXGen another
//! project's network fills unseen texels, with PartField one splits instances into parts.
//!
//! [`encoding_report`] compares the numbers that a method stored with the truth and reports which encoding they fit, by
//! [`encoding_fit`].
//!
//! Steps: [`geometry`] reads the scene as methods see it and determines which instance each pixel shows; [`lift`]
//! writes the estimate into an atlas; [`fill`] computes unseen texels; [`maps`] writes the files.

pub mod adapter;
pub mod bounds;
pub mod bridges;
pub mod delight;
pub mod encoding_fit;
pub mod encoding_report;
mod error;
pub mod estimate;
pub mod estimate_source;
pub mod fill;
pub mod geometry;
pub mod import;
pub mod lift;
pub mod maps;
pub mod median;
pub mod nn;
pub mod procedural;
pub mod submission;

pub use error::BaselineError;

/// The baselines that need a dataset and no options. Each is a command: `mateval baseline NAME`.
pub const BASELINES: [submission::Baseline; 2] = [bounds::TRUTH, bounds::GREY];
