//! The one error of this crate.

use std::path::PathBuf;

/// Why a baseline could not be made.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// The file system refused.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was tried, as in "read" or "write".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The output is in the way.
    #[error("'{}' is already there; choose another --out, or add --force to replace it", .0.display())]
    Exists(PathBuf),
    /// `--force` would remove something that is no submission.
    #[error("'{}' is there and holds no submission.json: it is not replaced; choose another --out", .0.display())]
    NotASubmission(PathBuf),
    /// The dataset could not be read, or the submission not written.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// A picture could not be written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}
