//! Findings: faults of a `.mtlx` file, each with the name and the line of its element.

use serde::{Serialize, Serializer};

/// The kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Code {
    /// The text is not XML, or the XML exceeds a limit.
    Xml,
    /// An element that is not supported where it stands.
    UnknownElement,
    /// An attribute that is not supported, or is missing.
    Attribute,
    /// Two elements of one name.
    DuplicateName,
    /// A node that is not supported.
    UnknownNode,
    /// A type that does not exist, is not supported, or does not fit.
    Type,
    /// An input that the node does not have.
    UnknownInput,
    /// A value that is not one of its type, or is out of range.
    Value,
    /// A connection to something that does not exist.
    Connection,
    /// A node that depends on itself.
    Cycle,
    /// An output that is missing, or is not supported.
    Output,
    /// More nodes or parameters than the limits allow.
    TooMany,
}

impl Code {
    /// The word in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Xml => "xml",
            Self::UnknownElement => "unknown_element",
            Self::Attribute => "attribute",
            Self::DuplicateName => "duplicate_name",
            Self::UnknownNode => "unknown_node",
            Self::Type => "type",
            Self::UnknownInput => "unknown_input",
            Self::Value => "value",
            Self::Connection => "connection",
            Self::Cycle => "cycle",
            Self::Output => "output",
            Self::TooMany => "too_many",
        }
    }
}

impl Serialize for Code {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

/// One fault. Findings sort by line, element, code and message.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Finding {
    /// The line, from 1; none where the fault concerns the whole file.
    pub line: Option<usize>,
    /// The element, as in `noise2d 'grain'`; none where the fault concerns no element.
    pub element: Option<String>,
    /// The kind of fault.
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

/// Collects findings up to a limit.
#[derive(Debug)]
pub(crate) struct Findings {
    found: Vec<Finding>,
    most: usize,
    more: usize,
}

impl Findings {
    /// No findings yet.
    pub(crate) fn new(most: usize) -> Self {
        Self { found: Vec::new(), most, more: 0 }
    }

    /// Adds a finding, or counts it where there are too many.
    pub(crate) fn add(&mut self, code: Code, line: Option<usize>, element: Option<String>, message: String) {
        if self.found.len() < self.most {
            self.found.push(Finding { line, element, code, message });
        } else {
            self.more += 1;
        }
    }

    /// Whether nothing was found.
    pub(crate) fn is_empty(&self) -> bool {
        self.found.is_empty() && self.more == 0
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
