//! Baselines: methods that come with the tool.
//!
//! In: a dataset, and for most an estimate of the input view ([`estimate`]; other people's pictures by an [`adapter`]).
//! Out: a submission folder like any other. [`truth`] copies the baked truth (the ceiling that an atlas of this size
//! can reach), [`grey`] knows nothing (the floor), [`nn`] lifts the estimate to the atlases, [`homogeneous`] takes its
//! medians, [`import`] rebakes meshes with uv of their own, [`texgen`] lets another project's network fill what is not
//! seen, [`partfield`] lets one split instances into parts.
//!
//! Between: [`geometry`] is the scene as methods see it, [`seen`] which instance each pixel shows; [`lift`] writes the
//! picture into an atlas, [`fill`] finds what is not seen, [`maps`] writes files.

pub mod adapter;
pub mod error;
pub mod estimate;
pub mod estimate_source;
pub mod fill;
pub mod geometry;
pub mod grey;
pub mod homogeneous;
pub mod import;
pub mod lift;
pub mod maps;
pub mod median;
pub mod nn;
pub mod objects;
pub mod part_colors;
pub mod partfield;
pub mod seen;
pub mod seen_cloud;
pub mod submission;
pub mod texgen;
pub mod truth;

pub use error::BaselineError;
