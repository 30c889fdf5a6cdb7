//! The one error of this crate.

use std::path::PathBuf;

/// Why a dataset could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PrepError {
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
    /// A recipe that cannot be carried out; every fault is listed.
    #[error("recipe '{}': {}", path.display(), faults.join("; "))]
    Recipe {
        /// The recipe.
        path: PathBuf,
        /// All that is wrong with it.
        faults: Vec<String>,
    },
    /// Rules or lists that cannot be read.
    #[error("'{}': {what}", path.display())]
    Rules {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The output is in the way.
    #[error("'{}' {what}", path.display())]
    Output {
        /// The dataset's folder.
        path: PathBuf,
        /// What is wrong with it and what to do.
        what: String,
    },
    /// A scene from which nothing can be made.
    #[error("scene '{scene}': {what}")]
    Scene {
        /// Its id.
        scene: String,
        /// What is missing.
        what: String,
    },
    /// The source could not be read at all.
    #[error(transparent)]
    Source(#[from] mateval_sources::SourceError),
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

impl PrepError {
    /// An [`PrepError::Io`]; to be used with `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}
