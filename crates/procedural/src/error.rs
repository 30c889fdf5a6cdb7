//! The one error of this crate, and findings: faults of a `.mtlx` file, each with the name and the line of its element.

use std::path::PathBuf;

use serde::{Serialize, Serializer};

use crate::value::ValueError;

/// Why a graph could not be read, set or evaluated.
#[derive(Debug, thiserror::Error)]
pub enum ProceduralError {
    /// A file could not be read.
    #[error("cannot read '{}': {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// A file is not a graph that can be evaluated.
    #[error("'{name}' is not a graph that can be evaluated: {}: {}", counted(findings.len()), findings[0])]
    Invalid {
        name: String,
        /// Everything that was found; never empty.
        findings: Vec<Finding>,
    },
    /// A graph has no parameter of this name.
    #[error("'{graph}' has no parameter '{name}'; expected one of: {known}")]
    UnknownParameter {
        graph: String,
        name: String,
        /// The names of the parameters, with commas between them.
        known: String,
    },
    /// A parameter that has a value of its own at every point.
    #[error("parameter '{name}' of '{graph}' cannot be set: it is the extent of a pixel at every point")]
    SetAtEveryPoint { graph: String, name: String },
    /// A text is not a value of the parameter's type.
    #[error("parameter '{name}' of '{graph}': {reason}")]
    BadValue {
        graph: String,
        name: String,
        /// What was expected and what was found.
        reason: ValueError,
    },
    /// A value is out of the parameter's range.
    #[error("parameter '{name}' of '{graph}': expected {}, found {found}", range(*least, *most))]
    OutOfRange {
        graph: String,
        name: String,
        /// The least value of the component, if it has one.
        least: Option<f64>,
        /// The greatest value of the component, if it has one.
        most: Option<f64>,
        found: f64,
    },
    /// The size of a picture is not usable.
    #[error(
        "expected a size above 0 metres and 1 to {most} pixels a side, found {size_metres} metres and {resolution} pixels"
    )]
    PictureSize {
        /// The side in metres.
        size_metres: f64,
        /// The side in pixels.
        resolution: usize,
        /// The greatest number of pixels a side.
        most: usize,
    },
    /// There is nothing to fit a graph to.
    #[error(
        "cannot fit a graph: expected points with finite places, colours from 0 up, and footprints and weights above 0"
    )]
    NoPoints,
    /// A graph has a value that is infinite or not a number.
    #[error("'{graph}' is not finite at ({u}, {v}) metres: its {output} is {value}; choose other parameters")]
    NotFinite { graph: String, output: &'static str, u: f64, v: f64, value: f64 },
}

fn counted(findings: usize) -> String {
    if findings == 1 { "1 finding".to_owned() } else { format!("{findings} findings, of which the first is") }
}

fn range(least: Option<f64>, most: Option<f64>) -> String {
    match (least, most) {
        (Some(least), Some(most)) => format!("{least} to {most}"),
        (Some(least), None) => format!("at least {least}"),
        (None, Some(most)) => format!("at most {most}"),
        (None, None) => "any number".to_owned(),
    }
}

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
