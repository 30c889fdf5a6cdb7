//! Type of what `eval verify` writes.

use mateval_scene::Finding;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The format name of this version of a verification.
pub const VERIFICATION_FORMAT: &str = "mateval-verification/1";

/// Whether a result states what its submission scores.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VerificationFile {
    /// Always `mateval-verification/1`.
    pub format: String,
    /// Program and version, as in `mateval 0.1.0`.
    pub tool: String,
    /// SHA-256 of the result file, hex.
    pub result_sha256: String,
    /// The submission that the result names.
    pub submission_sha256: String,
    /// The dataset that the result names.
    pub dataset_manifest_sha256: String,
    /// Whether every number was reproduced: exactly, LPIPS to 1e-5.
    pub confirmed: bool,
    /// How many values of the result differ; 0 where none were computed again because hashes or rules differ.
    pub differences: usize,
    /// What differs: hashes and rules, or the first twenty values. Empty where `confirmed`.
    pub findings: Vec<Finding>,
}
