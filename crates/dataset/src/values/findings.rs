//! Findings, which state a fault of an input, its place, and what was done about it.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The input cannot be used.
    Error,
    /// Something was left out or replaced.
    Warning,
    /// Something was repaired without loss.
    Note,
}

impl std::fmt::Display for Severity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Note => "note",
        })
    }
}

/// One fault of an input. Findings sort by severity, then code, file and place.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Finding {
    /// Whether the input could be used.
    pub severity: Severity,
    /// A stable word for the kind of fault, as in `missing_file`; snake_case.
    pub code: String,
    /// The file, relative to the root of what was read, with forward slashes.
    pub file: String,
    /// Where in the file: a JSON pointer, `line 12`, or an element as in `shape 'Mesh206'`. Empty for the whole file.
    pub place: String,
    /// What was expected and what was found.
    pub message: String,
    /// What was done instead, or what to do.
    pub action: String,
}

/// The number of findings of one severity and code.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FindingCount {
    /// The severity.
    pub severity: Severity,
    /// The code, as in a finding.
    pub code: String,
    /// Number of findings.
    pub count: usize,
}

impl FindingCount {
    /// Counts findings; sorted by severity, then code.
    pub fn of<'a>(findings: impl Iterator<Item = &'a Finding>) -> Vec<Self> {
        let mut counts = BTreeMap::new();
        for finding in findings {
            *counts.entry((finding.severity, finding.code.as_str())).or_insert(0) += 1;
        }
        let count =
            |((severity, code), count): ((Severity, &str), usize)| Self { severity, code: code.to_owned(), count };
        counts.into_iter().map(count).collect()
    }
}

impl Finding {
    /// A finding, its texts in the order of the fields.
    pub fn new(
        severity: Severity,
        code: &str,
        file: impl Into<String>,
        place: impl Into<String>,
        message: impl Into<String>,
        action: impl Into<String>,
    ) -> Self {
        let code = code.to_owned();
        Self { severity, code, file: file.into(), place: place.into(), message: message.into(), action: action.into() }
    }

    /// All findings, each after a line break and two blanks.
    pub fn list(findings: &[Self]) -> String {
        findings.iter().fold(String::new(), |mut text, finding| {
            // Writing to a String cannot fail.
            let _ = write!(text, "\n  {finding}");
            text
        })
    }
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} [{}] '{}'", self.severity, self.code, self.file)?;
        if !self.place.is_empty() {
            write!(f, " {}", self.place)?;
        }
        write!(f, ": {}; {}", self.message, self.action)
    }
}
