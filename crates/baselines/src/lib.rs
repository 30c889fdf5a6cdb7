//! Baselines: methods that come with the tool.
//!
//! In: a dataset. Out: a submission folder like any other. [`truth`] copies the baked truth (the ceiling that an atlas
//! of this size can reach), [`grey`] knows nothing (the floor).

pub mod error;
pub mod grey;
pub mod submission;
pub mod truth;

pub use error::BaselineError;
