//! Whether `eval verify` confirmed a result, as `RESULT.verified.json` beside the result states.

use std::path::{Path, PathBuf};

use mateval_scene::json;
use mateval_scene::manifest::sha256_of_file;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReportError;
use mateval_eval::result::ResultFile;
use mateval_eval::verify::{VERIFICATION_FORMAT, VerificationFile};

/// Whether a result was verified.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verified {
    /// It was not verified.
    No,
    /// `eval verify` computed the same numbers.
    Confirmed,
    /// `eval verify` computed different numbers.
    Refuted,
    /// The verification belongs to other bytes: the result, or what it was made from, has changed since.
    Stale,
}

/// `DIR/NAME.verified.json` of `DIR/NAME.json`.
pub fn sidecar(result: &Path) -> PathBuf {
    result.with_extension("verified.json")
}

/// The state that the sidecar of the result in the file `path` gives; `result` is the content of that file.
pub fn read(path: &Path, result: &ResultFile) -> Result<Verified, ReportError> {
    let sidecar = sidecar(path);
    if !sidecar.exists() {
        return Ok(Verified::No);
    }
    let file: VerificationFile = json::read_format(&sidecar, VERIFICATION_FORMAT)?;
    let is_of_these_bytes = file.result_sha256 == sha256_of_file(path)?
        && file.submission_sha256 == result.submission.sha256
        && file.dataset_manifest_sha256 == result.dataset.manifest_sha256;
    Ok(match (is_of_these_bytes, file.confirmed) {
        (false, _) => Verified::Stale,
        (true, true) => Verified::Confirmed,
        (true, false) => Verified::Refuted,
    })
}
