//! The one error of this crate.

use std::path::PathBuf;

/// Why something could not be shown.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
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
    /// What was asked for does not go together.
    #[error("{0}")]
    Invalid(String),
    /// The dataset or the submission could not be read.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// A scene could not be rendered or scored again.
    #[error(transparent)]
    Eval(#[from] mateval_eval::EvalError),
    /// The submission could not be read.
    #[error(transparent)]
    Submission(#[from] mateval_submission::SubmissionError),
    /// A picture could not be read.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
    /// Two pictures could not be compared.
    #[error("{what}: {source}")]
    Metric {
        /// Which pictures.
        what: String,
        /// Why not.
        source: mateval_metrics::MetricError,
    },
}
