//! Why one file of a submission cannot be used.

/// The fault of one file. `eval lint` reports it as a finding; scoring replaces the map by its default.
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
