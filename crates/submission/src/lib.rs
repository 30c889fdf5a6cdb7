//! Submissions, read as untrusted input.
//!
//! In: a folder or an archive, and the dataset that it answers. Out: maps ready to be rendered ([`prediction`]), the
//! hash that identifies the submission ([`hashed_submission`]), and findings about everything that is wrong ([`lint`],
//! [`method_name`]).
//!
//! Between: [`archive`] unpacks within limits, [`submitted_file`] reads a file once and hashes the same bytes,
//! [`map_file`] decodes one map, [`bad_texels`] replaces what it holds besides finite numbers in range ([`reach`] finds
//! the texels that count, by the [`atlas_meshes`]), [`texel_map`] finds where an atlas's texels lie on the surface and
//! which of them the input view shows.

pub mod archive;
pub mod atlas_meshes;
pub mod bad_texels;
mod coverage;
pub mod default_map;
pub mod error;
pub mod file_fault;
pub mod hashed_file;
pub mod hashed_submission;
pub mod lint;
pub mod map_file;
mod map_folder;
pub mod memory_budget;
pub mod method_name;
mod polygon;
pub mod prediction;
pub mod reach;
pub mod submission_json;
pub mod submitted_file;
pub mod texel_map;
mod texel_set;

pub use error::SubmissionError;
