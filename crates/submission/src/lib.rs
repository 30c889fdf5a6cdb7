//! Submissions as anyone sends them.
//!
//! In: a folder or an archive of untrusted files, and the dataset that it answers. Out: maps ready to be rendered
//! ([`prediction`]), and findings about everything that is wrong ([`lint`]).
//!
//! Between: [`archive`] unpacks within limits, [`map_file`] reads one map, [`texel_map`] says where an atlas's texels lie
//! and which of them the input view shows.

pub mod archive;
mod coverage;
pub mod error;
pub mod lint;
pub mod map_file;
pub mod prediction;
pub mod texel_map;

pub use error::SubmissionError;
