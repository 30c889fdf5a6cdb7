//! Errors that were found after publication, from a file that the maintainer of the leaderboard writes.

use std::path::Path;

use mateval_scene::json;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReportError;

/// The format of this version of errata.
pub const ERRATA_FORMAT: &str = "mateval-errata/1";

/// Errata, in the order in which they are shown.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ErrataFile {
    /// Always `mateval-errata/1`.
    pub format: String,
    /// One entry for each error.
    pub entries: Vec<Erratum>,
}

/// One error.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Erratum {
    /// When it was found, as in `2026-03-01`.
    pub date: String,
    /// A title of a few words.
    pub title: String,
    /// What was wrong, and how it was corrected.
    pub text: String,
    /// Names of the methods and scenes that it affects; all of them if empty.
    #[serde(default)]
    pub affects: Vec<String>,
}

impl ErrataFile {
    /// Reads the errata in the file `path`; fails if they have another format.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        Ok(json::read_format(path, ERRATA_FORMAT)?)
    }
}
