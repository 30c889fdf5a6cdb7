//! Writes folders and text files, with the path in the error.

use std::path::{Path, PathBuf};

/// Why the built-in scenes could not be written.
#[derive(Debug, thiserror::Error)]
pub enum SampleError {
    /// An operation of the file system failed.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// The operation, as in "read" or "write".
        action: &'static str,
        path: PathBuf,
        source: std::io::Error,
    },
    /// A picture could not be written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> SampleError {
    let path = path.to_owned();
    move |source| SampleError::Io { action, path, source }
}

pub(crate) fn create_folder(path: &Path) -> Result<(), SampleError> {
    std::fs::create_dir_all(path).map_err(io("create", path))
}

/// Writes `text` to `path`, replacing a file of that name.
pub(crate) fn write_text(path: &Path, text: &str) -> Result<(), SampleError> {
    std::fs::write(path, text).map_err(io("write", path))
}
