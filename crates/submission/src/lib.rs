//! Submissions, read as untrusted input.
//!
//! In: a folder or an archive, and the dataset that it answers. Out: maps ready to be rendered and the hash that
//! identifies the submission ([`prediction`]), and findings about everything that is wrong ([`lint`]).
//!
//! Between: [`archive`] unpacks within limits, [`files`] reads a file once and hashes the same bytes, [`map_file`]
//! decodes one map and replaces what it holds besides finite numbers in range ([`atlas`] finds the texels that count),
//! [`texel_map`] finds where an atlas's texels lie on the surface and which of them the input view shows.

pub mod archive;
pub mod atlas;
pub mod error;
pub mod files;
pub mod lint;
pub mod map_file;
pub mod prediction;
pub mod texel_map;

pub use error::SubmissionError;
