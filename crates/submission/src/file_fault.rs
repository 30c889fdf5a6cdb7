//! What is wrong with one file of a submission.

use mateval_scene::{Finding, Severity};

/// The fault of one file. `eval lint` reports it as a finding. Scoring replaces the map by its default, or, if only a few
/// texels are bad, those.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileFault {
    /// A stable word, as in `not_square`.
    pub code: &'static str,
    /// Where in the file, as in `texel (3, 2)`; empty for the whole file.
    pub place: String,
    /// What was expected and what was found.
    pub message: String,
    /// What to do.
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
