//! A file of a submission, read once: its bytes, and the hash of these same bytes.
//!
//! Scoring, verification and `eval lint` read a submission's files here and nowhere else. If a file is replaced during
//! a run, the result therefore has the hash of the bytes that were scored, never that of the other version.
//!
//! The files are untrusted input: nothing outside the submission's folder is read, and no more than a given size.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use mateval_image::limits::read_at_most;
use mateval_scene::manifest::sha256_of_bytes;

use crate::file_fault::FileFault;
use crate::hashed_file::HashedFile;

/// The bytes of a file and their hash.
pub struct SubmittedFile {
    path: PathBuf,
    hashed: HashedFile,
    bytes: Vec<u8>,
}

impl SubmittedFile {
    /// Reads a file of at most `most` bytes that lies in the folder `submission`.
    pub fn read(submission: &Path, path: &Path, most: u64) -> Result<Self, FileFault> {
        let place = place_inside(submission, path)?;
        let bytes = read_at_most(&place, most).map_err(|error| match error.kind() {
            ErrorKind::FileTooLarge => {
                let action = "save it with compression, or with fewer texels";
                FileFault::new("file_too_large", format!("more than {most} bytes"), action)
            }
            _ => FileFault::unreadable(&error),
        })?;
        Ok(Self::from_bytes(submission, path, bytes))
    }

    /// A file that has been read already.
    pub fn from_bytes(submission: &Path, path: &Path, bytes: Vec<u8>) -> Self {
        let hashed = HashedFile { path: relative(submission, path), sha256: sha256_of_bytes(&bytes) };
        Self { path: path.to_owned(), hashed, bytes }
    }

    /// Where it was read; its ending says what kind of file it should be.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its path in the submission and the hash of its bytes.
    pub fn hashed(&self) -> &HashedFile {
        &self.hashed
    }

    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Gives up the bytes, so that a decoder need not copy them.
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}

/// A path relative to the submission's folder, with forward slashes.
pub(crate) fn relative(submission: &Path, path: &Path) -> String {
    path.strip_prefix(submission).unwrap_or(path).to_string_lossy().replace('\\', "/")
}

/// Where a file lies once links are followed. Fails where that is outside the submission's folder, or no ordinary file.
fn place_inside(submission: &Path, path: &Path) -> Result<PathBuf, FileFault> {
    let unreadable = |error: std::io::Error| FileFault::unreadable(&error);
    let place = path.canonicalize().map_err(|error| match error.kind() {
        ErrorKind::NotFound => {
            FileFault::new("broken_link", "a link to a file that does not exist", "replace the link by the file itself")
        }
        _ => unreadable(error),
    })?;
    if !place.starts_with(submission.canonicalize().map_err(unreadable)?) {
        let message = "a link that leads out of the submission's folder; it is not followed";
        return Err(FileFault::new("link_leads_out", message, "replace the link by the file itself"));
    }
    if !place.metadata().map_err(unreadable)?.is_file() {
        return Err(FileFault::new("not_a_file", "not an ordinary file", "replace it by an ordinary file"));
    }
    Ok(place)
}
