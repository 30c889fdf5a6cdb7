//! The one error of this crate.

use std::path::PathBuf;

/// Why a submission could not be read.
#[derive(Debug, thiserror::Error)]
pub enum SubmissionError {
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
    /// An archive that is not unpacked.
    #[error("'{}' is not unpacked:{}", path.display(), mateval_scene::Finding::list(findings))]
    Archive {
        /// The archive.
        path: PathBuf,
        /// What is wrong with it.
        findings: Vec<mateval_scene::Finding>,
    },
    /// What was asked for does not go together.
    #[error("{0}")]
    Invalid(String),
    /// The dataset or the submission could not be read.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// The tracer cannot work with the scene.
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    /// A picture could not be read.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}
