//! The one error of this crate.

use std::path::PathBuf;

/// Why nothing could be said of a dataset.
#[derive(Debug, thiserror::Error)]
pub enum AuditError {
    /// The file system refused.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was tried, as in "read" or "write".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The output is in the way, or the input is no finished dataset.
    #[error("'{}' {what}", path.display())]
    Output {
        /// The folder.
        path: PathBuf,
        /// What is wrong with it and what to do.
        what: String,
    },
    /// A scene of which nothing can be said.
    #[error("scene '{scene}': {what}")]
    Scene {
        /// Its id.
        scene: String,
        /// What is missing.
        what: String,
    },
    /// Pictures could not be rendered or read.
    #[error(transparent)]
    Prep(#[from] mateval_prep::PrepError),
    /// The tracer cannot work with the scene.
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    /// The dataset could not be read or written.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl AuditError {
    /// An [`AuditError::Io`]; to be used with `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}
