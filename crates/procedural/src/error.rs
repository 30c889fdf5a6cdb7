//! The one error of this crate, and findings: faults of a `.mtlx` file, each with the name and the line of its element.

use std::path::PathBuf;

use serde::Serialize;

use crate::value::words;

/// Why a graph could not be read, set or evaluated.
#[derive(Debug, thiserror::Error)]
pub enum ProceduralError {
    #[error("cannot read '{}': {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// A file is not a graph that can be evaluated.
    #[error("'{name}' is not a graph that can be evaluated: {}: {}", counted(findings.len()), findings[0])]
    Invalid {
        name: String,
        /// Everything that was found; never empty.
        findings: Vec<Finding>,
    },
    /// A parameter, a size, points or a graph's own values cannot be used: the message states what was expected.
    #[error("{0}")]
    Unusable(String),
}

fn counted(findings: usize) -> String {
    if findings == 1 { "1 finding".to_owned() } else { format!("{findings} findings, of which the first is") }
}

words! {
    /// The kind of a fault.
    pub enum Code {
        /// The text is not XML, or the XML exceeds a limit.
        Xml = "xml",
        /// An element that is not supported where it stands.
        UnknownElement = "unknown_element",
        /// An attribute that is not supported, or is missing.
        Attribute = "attribute",
        /// Two elements of one name.
        DuplicateName = "duplicate_name",
        /// A node that is not supported.
        UnknownNode = "unknown_node",
        /// A type that does not exist, is not supported, or does not fit.
        Type = "type",
        /// An input that the node does not have.
        UnknownInput = "unknown_input",
        /// A value that is not one of its type, or is out of range.
        Value = "value",
        /// A connection to something that does not exist.
        Connection = "connection",
        /// A node that depends on itself.
        Cycle = "cycle",
        /// An output that is missing, or is not supported.
        Output = "output",
        /// More nodes or parameters than the limits allow.
        TooMany = "too_many",
    }
}

/// One fault. Findings sort by line, element, code and message.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Finding {
    /// The line, from 1; absent if the fault concerns the whole file.
    pub line: Option<usize>,
    /// The element, as in `noise2d 'grain'`; absent if the fault concerns no element.
    pub element: Option<String>,
    pub code: Code,
    /// What was expected and what was found.
    pub message: String,
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        if let Some(element) = &self.element {
            write!(f, "{element}: ")?;
        }
        write!(f, "{} [{}]", self.message, self.code.word())
    }
}

/// The most findings that are listed. Further ones are only counted.
const MOST_FINDINGS: usize = 200;

/// Collects findings up to a limit.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    found: Vec<Finding>,
    more: usize,
}

impl Findings {
    pub(crate) fn add(&mut self, code: Code, line: Option<usize>, element: Option<String>, message: String) {
        if self.found.len() < MOST_FINDINGS {
            self.found.push(Finding { line, element, code, message });
        } else {
            self.more += 1;
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// The findings in order, and one more that counts those beyond the limit.
    pub(crate) fn into_sorted(mut self) -> Vec<Finding> {
        self.found.sort();
        if self.more > 0 {
            let message = format!("{} more findings are not listed", self.more);
            self.found.push(Finding { line: None, element: None, code: Code::TooMany, message });
        }
        self.found
    }
}
