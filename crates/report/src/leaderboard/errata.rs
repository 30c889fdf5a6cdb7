//! What was found wrong after it was published, from a file that the leaderboard's keeper writes.

use std::path::Path;

use mateval_scene::json;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReportError;

/// The word for this version of errata.
pub const ERRATA_FORMAT: &str = "mateval-errata/1";

/// Errata, as they are to be shown.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ErrataFile {
    /// Always `mateval-errata/1`.
    pub format: String,
    /// One a fault.
    pub entries: Vec<Erratum>,
}

/// One fault.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Erratum {
    /// When it was found, as in `2026-03-01`.
    pub date: String,
    /// In a few words.
    pub title: String,
    /// What was wrong, and what was done.
    pub text: String,
    /// Names of methods and scenes that it touches; all where empty.
    #[serde(default)]
    pub affects: Vec<String>,
}

impl ErrataFile {
    /// Reads the errata in the file `path`; fails if they have another format.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        let errata: Self = json::read(path)?;
        match errata.format == ERRATA_FORMAT {
            true => Ok(errata),
            false => Err(ReportError::Format { path: path.to_owned(), found: errata.format, expected: ERRATA_FORMAT }),
        }
    }
}
