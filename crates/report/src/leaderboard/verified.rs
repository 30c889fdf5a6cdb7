//! Whether `eval verify` has confirmed a result: what `RESULT.verified.json` beside it says.

use std::path::{Path, PathBuf};

use mateval_scene::json;
use mateval_scene::manifest::sha256_of_file;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReportError;
use mateval_eval::result::ResultFile;
use mateval_eval::verify::{VERIFICATION_FORMAT, VerificationFile};

/// Whether a result's numbers were computed again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verified {
    /// Nobody has.
    No,
    /// They have come out the same.
    Confirmed,
    /// They have not.
    Refuted,
    /// The verification is of other bytes: the result, or what it was made of, has changed since.
    Stale,
}

/// `DIR/NAME.verified.json` of `DIR/NAME.json`.
pub fn sidecar(result: &Path) -> PathBuf {
    result.with_extension("verified.json")
}

/// What the sidecar of the result in `path` says; `result` is what that file holds.
pub fn read(path: &Path, result: &ResultFile) -> Result<Verified, ReportError> {
    let sidecar = sidecar(path);
    if !sidecar.exists() {
        return Ok(Verified::No);
    }
    let said: VerificationFile = json::read(&sidecar)?;
    if said.format != VERIFICATION_FORMAT {
        return Err(ReportError::Format { path: sidecar, found: said.format, expected: VERIFICATION_FORMAT });
    }
    let is_of_this = said.result_sha256 == sha256_of_file(path)?
        && said.submission_sha256 == result.submission.sha256
        && said.dataset_manifest_sha256 == result.dataset.manifest_sha256;
    Ok(match (is_of_this, said.confirmed) {
        (false, _) => Verified::Stale,
        (true, true) => Verified::Confirmed,
        (true, false) => Verified::Refuted,
    })
}
