//! The error of this crate.

use std::path::PathBuf;

use crate::{Finding, SceneId};

/// Why a dataset or a part of it could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
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
    /// A file breaks the format; every fault is listed.
    #[error("'{}' is not valid:{}", path.display(), Finding::list(findings))]
    Invalid {
        /// The file or folder.
        path: PathBuf,
        /// All its faults.
        findings: Vec<Finding>,
    },
    /// A file of another version than the one that is read here.
    #[error(
        "'{}' has the format '{found}', and this version of MatEval reads '{expected}': make the file again, or use the \
         version that made it",
        path.display()
    )]
    Format {
        /// The file.
        path: PathBuf,
        /// Its format, shortened.
        found: String,
        /// The format that this version reads.
        expected: &'static str,
    },
    /// A file that is valid, but of a kind that is not read here.
    #[error("'{}': unsupported: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What was found and what is supported.
        what: String,
    },
    /// Scenes were requested that the dataset does not have.
    #[error("'{}' has no scene {}; it has {}", dataset.display(), quoted(unknown), quoted(known))]
    UnknownScenes {
        /// The dataset's folder.
        dataset: PathBuf,
        /// The scenes that it does not have.
        unknown: Vec<SceneId>,
        /// All scenes that it has.
        known: Vec<SceneId>,
    },
    /// An output exists and replacing it was not allowed.
    #[error("'{}' already exists; choose another {place}, or add --force to overwrite it", path.display())]
    Exists {
        /// The output.
        path: PathBuf,
        /// The argument of the command that names the output, as in `--out`.
        place: &'static str,
    },
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl SceneError {
    /// A constructor of [`SceneError::Io`] for `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}

/// `'a', 'b'`.
fn quoted(scenes: &[SceneId]) -> String {
    scenes.iter().map(|scene| format!("'{scene}'")).collect::<Vec<_>>().join(", ")
}
