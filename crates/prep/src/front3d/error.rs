//! The one error of this reader.

use std::path::PathBuf;

/// Why nothing could be made of a house.
#[derive(Debug, thiserror::Error)]
pub enum Front3dError {
    /// The file system refused.
    #[error("cannot read '{}': {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is no house, or too large a one.
    #[error("'{}': {what}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What was expected and what was found.
        what: String,
    },
}
