//! The error type of this crate.

use std::path::PathBuf;

/// Why the built-in scenes could not be written.
#[derive(Debug, thiserror::Error)]
pub enum SampleError {
    /// An operation of the file system failed.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// The operation, as in "read" or "write".
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// A picture could not be written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl SampleError {
    /// Makes a [`SampleError::Io`] of an [`std::io::Error`], for use with `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}
