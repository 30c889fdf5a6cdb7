//! The one error of this module: why a scene could not be read at all. All lesser faults are findings.

use std::path::PathBuf;

/// Why a Mitsuba scene could not be read.
#[derive(Debug, thiserror::Error)]
pub enum BitterliError {
    /// The file system refused.
    #[error("cannot read '{}': {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not XML, not a scene, without a usable camera, or beyond a limit.
    #[error("'{}': {what}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What was expected and what was found.
        what: String,
    },
}
