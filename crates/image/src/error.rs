//! The error of this crate.

use std::path::PathBuf;

/// Why a picture could not be read, written or made.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file system refused.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was attempted, as in "read" or "write".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file is damaged, of another kind than expected, or beyond a limit.
    #[error("'{}': {what}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What was expected and what was found.
        what: String,
    },
    /// The file is valid, but of a kind that is not read here.
    #[error("'{}': unsupported: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What was found and what is supported.
        what: String,
    },
    /// The number of pixels is not width times height.
    #[error("a picture of {width}x{height} needs {expected} pixels, {found} were given")]
    PixelCount {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Width times height.
        expected: usize,
        /// The number of pixels given.
        found: usize,
    },
}
