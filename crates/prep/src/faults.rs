//! Collects the faults of a dataset on disk.

use mateval_scene::{Finding, Severity};

/// Faults of a dataset, collected so that all of them are reported together.
#[derive(Debug, Default)]
pub struct Faults {
    /// All of them, in the order in which they were found.
    pub all: Vec<Finding>,
    /// A prefix for the file of every fault that is added.
    pub prefix: String,
}

impl Faults {
    /// Adds a fault of `file` at `place`.
    pub fn add(&mut self, code: &str, file: &str, place: impl Into<String>, message: impl Into<String>) {
        self.all.push(Finding {
            severity: Severity::Error,
            code: code.to_owned(),
            file: format!("{}{file}", self.prefix),
            place: place.into(),
            message: message.into(),
            action: "download the dataset again, or build it again".to_owned(),
        });
    }

    /// The value; or none, after adding the reason why it could not be read.
    pub fn read<T, E: std::fmt::Display>(&mut self, file: &str, result: Result<T, E>) -> Option<T> {
        result.map_err(|error| self.add("unreadable", file, "", error.to_string())).ok()
    }
}
