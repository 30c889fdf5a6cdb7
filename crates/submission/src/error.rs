//! What can be wrong with a submission: errors that end a run, faults of single files, findings.

use std::borrow::Cow;
use std::path::PathBuf;

use mateval_dataset::{Finding, Severity};
use mateval_files::FileError;

#[derive(Debug, thiserror::Error)]
pub enum SubmissionError {
    #[error(transparent)]
    Files(#[from] FileError),
    #[error("cannot open '{}' as a submission: expected a folder, a .zip or a .tar.gz{hint}", path.display())]
    UnknownKind {
        path: PathBuf,
        /// What it is instead, as a sentence's end; empty where that is unknown.
        hint: Cow<'static, str>,
    },
    #[error("cannot unpack '{}':{}", path.display(), Finding::list(findings))]
    Archive { path: PathBuf, findings: Vec<Finding> },
    /// A file of the submission that nothing can replace.
    #[error("cannot use '{}': {fault}", path.display())]
    File { path: PathBuf, fault: FileFault },
    /// The public files of the dataset contradict each other.
    #[error("cannot check against '{}': expected {expected}, found {found}; run `mateval prep verify`", scene_file.display())]
    UnsoundScene { scene_file: PathBuf, expected: String, found: String },
    #[error(transparent)]
    Dataset(#[from] mateval_dataset::DatasetError),
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

/// The fault of one file. `eval lint` reports it as a finding. Scoring replaces the map by its default, or, if only a
/// few texels are bad, those.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileFault {
    /// A stable word, as in `not_square`.
    pub code: &'static str,
    /// Where in the file, as in `texel (3, 2)`; empty for the whole file.
    pub place: String,
    pub message: String,
    pub action: &'static str,
}

impl FileFault {
    pub(crate) fn new(code: &'static str, message: impl Into<String>, action: &'static str) -> Self {
        Self { code, place: String::new(), message: message.into(), action }
    }

    /// The finding about `file`, a path in the submission.
    pub(crate) fn into_finding(self, severity: Severity, file: String) -> Finding {
        let Self { code, place, message, action } = self;
        Finding { severity, code: code.to_owned(), file, place, message, action: action.to_owned() }
    }

    /// A file that the system does not let us read.
    pub(crate) fn unreadable(error: &std::io::Error) -> Self {
        Self::new("unreadable_file", error.to_string(), "make it an ordinary file that can be read")
    }
}

impl std::fmt::Display for FileFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        write!(f, "{}; {}", self.message, self.action)
    }
}

/// A fault that scoring refuses, or replaces by a default.
pub(crate) fn error(code: &str, file: &str, message: impl Into<String>, action: impl Into<String>) -> Finding {
    finding(Severity::Error, code, file, message, action)
}

/// Something that is scored, but probably a mistake.
pub(crate) fn warning(code: &str, file: &str, message: impl Into<String>, action: impl Into<String>) -> Finding {
    finding(Severity::Warning, code, file, message, action)
}

pub(crate) fn note(code: &str, file: &str, message: impl Into<String>, action: impl Into<String>) -> Finding {
    finding(Severity::Note, code, file, message, action)
}

pub(crate) fn finding(
    severity: Severity,
    code: &str,
    file: &str,
    message: impl Into<String>,
    action: impl Into<String>,
) -> Finding {
    Finding::new(severity, code, file, "", message, action)
}
