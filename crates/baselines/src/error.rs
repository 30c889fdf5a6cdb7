//! Why a baseline could not be made: the error of this crate.

use std::fmt::Display;
use std::path::Path;

/// Why a baseline could not be made.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// An input, or the place of the output. Callers cannot do more about it than show the message, which states what
    /// was found, what was expected and what to do.
    #[error("{0}")]
    Unusable(String),
    #[error(transparent)]
    Procedural(#[from] mateval_procedural::ProceduralError),
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    #[error(transparent)]
    Files(#[from] mateval_files::FileError),
    #[error(transparent)]
    Dataset(#[from] mateval_dataset::DatasetError),
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl BaselineError {
    /// The file or folder `path` cannot be used; `why` is the rest of the sentence.
    pub(crate) fn unusable(path: &Path, why: impl Display) -> Self {
        Self::Unusable(format!("'{}' {why}", path.display()))
    }
}
