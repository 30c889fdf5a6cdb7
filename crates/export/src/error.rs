//! The error of this crate.

use std::path::PathBuf;

/// Why a dataset could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The output exists; what it holds is not looked into, so it is never replaced.
    #[error("'{}' already exists; choose another --out, or remove it", path.display())]
    Exists {
        /// The output.
        path: PathBuf,
    },
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
    /// The manifest lists hidden files, which are not exported, and without which the copy would not be the dataset.
    #[error(
        "'{}' lists {} hidden files ('{}' first), which are never exported: remove them and make the dataset again",
        path.display(), files.len(), files[0]
    )]
    HiddenFiles {
        /// The manifest.
        path: PathBuf,
        /// The files, relative to the dataset; at least one.
        files: Vec<String>,
    },
    /// The dataset's pictures were not rendered.
    #[error("'{}' has no pictures of all its views yet; run `mateval prep render DATASET`", path.display())]
    NoPictures {
        /// The dataset.
        path: PathBuf,
    },
    /// The output would lie in the dataset.
    #[error("'{}' would lie in the dataset, whose manifest does not list it; choose another --out", path.display())]
    OutputInDataset {
        /// The output.
        path: PathBuf,
    },
    /// The Parquet file could not be written.
    #[error("cannot write '{}': {source}", path.display())]
    Parquet {
        /// The file.
        path: PathBuf,
        /// The writer's error.
        source: parquet::errors::ParquetError,
    },
    /// The dataset is not valid, or lacks scenes that the format needs, or the output could not be written.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl ExportError {
    /// A constructor of [`ExportError::Io`] for `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}
