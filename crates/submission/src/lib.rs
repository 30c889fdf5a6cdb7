//! Submissions, read as untrusted input.
//!
//! In: a folder or an archive, and the dataset that it answers. Out: maps ready to be rendered and the hash that
//! identifies the submission ([`prediction`]), and findings about everything that is wrong ([`lint`]).
//!
//! Between: [`archive`] unpacks within limits, [`files`] reads a file once and hashes the same bytes, [`map_file`] decodes
//! one map and replaces what it holds besides finite numbers in range ([`atlas`] finds the texels that count),
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

// OLD PATHS, removed after the merge.
#[doc(hidden)]
pub mod atlas_meshes {
    pub use crate::atlas::AtlasMeshes;
}
#[doc(hidden)]
pub mod bad_texels {
    pub use crate::map_file::{BASE_COLOR_RANGE, MOST_BAD_SHARE, SCALAR_RANGE};
}
#[doc(hidden)]
pub mod default_map {
    pub use crate::map_file::{MISSING_METALLIC, MISSING_ROUGHNESS};
}
#[doc(hidden)]
pub mod hashed_file {
    pub use crate::files::{HashedFile, submission_sha256};
}
#[doc(hidden)]
pub mod hashed_submission {
    pub use crate::prediction::hashed_submission;
}
#[doc(hidden)]
pub mod memory_budget {
    pub use crate::prediction::MAX_SCENE_BYTES;
}
#[doc(hidden)]
pub mod reach {
    pub use crate::atlas::REACH_MARGIN;
}
#[doc(hidden)]
pub mod submission_json {
    pub use crate::files::SubmissionJson;
}
#[doc(hidden)]
pub mod submitted_file {
    pub use crate::files::SubmittedFile;
}
