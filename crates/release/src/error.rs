//! The error of this crate.

use std::path::PathBuf;

use mateval_scene::Finding;

/// Why a release could not be described.
#[derive(Debug, thiserror::Error)]
pub enum ReleaseError {
    /// Files that were given are not about this dataset, or are something else: every reason. Correct them, or leave them
    /// out.
    #[error("these files cannot be part of the release's report:{}", Finding::list(.0))]
    UnfitFiles(Vec<Finding>),
    /// A folder of verdicts holds none: name another one.
    #[error(
        "'{}' holds no .json file; expected what `mateval prep compare --out` or `--format json` writes, in the folder \
         or directly below it",
        folder.display()
    )]
    NoVerdicts {
        /// The folder.
        folder: PathBuf,
    },
    /// A folder that is not the report of a release would be replaced: choose another one.
    #[error("'{}' exists and is not the report of a release; choose another --report", path.display())]
    NotAReport {
        /// The folder.
        path: PathBuf,
    },
    /// The report would lie in the dataset: choose another place.
    #[error("'{}' would lie in the dataset, whose manifest does not list it; choose another --report", path.display())]
    OutputInDataset {
        /// The report's folder.
        path: PathBuf,
    },
    /// The dataset, or a file of it, could not be read or written.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// The dataset could not be examined.
    #[error(transparent)]
    Audit(#[from] mateval_audit::AuditError),
    /// A result could not be checked.
    #[error(transparent)]
    Eval(#[from] mateval_eval::EvalError),
    /// The recipe could not be read.
    #[error(transparent)]
    Prep(#[from] mateval_prep::PrepError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}
