//! The hashes that identify a submission: of each of its files, and of the submission as a whole.

use mateval_scene::manifest::sha256_of_bytes;
use serde::Serialize;

/// A file of a submission and the hash of the bytes that were read from it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct HashedFile {
    /// Relative to the submission's folder, with forward slashes.
    pub path: String,
    /// SHA-256, hex.
    pub sha256: String,
}

/// The hash of a submission: SHA-256 over a line `<sha256>  <path>` for each file, in the order given. Results list
/// `submission.json` first, then the maps scene by scene.
pub fn submission_sha256(files: &[HashedFile]) -> String {
    let lines: String = files.iter().map(|file| format!("{}  {}\n", file.sha256, file.path)).collect();
    sha256_of_bytes(lines.as_bytes())
}
