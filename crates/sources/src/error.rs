//! The one error of all readers: why a source could not be read at all. All lesser faults are findings.

use std::path::PathBuf;

/// Why nothing could be made of a source.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The file system refused.
    #[error("cannot read '{}': {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is not what it should be (no XML, no scene, no house, without a usable camera), or beyond a limit.
    #[error("'{}': {what}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What was expected and what was found.
        what: String,
    },
}
