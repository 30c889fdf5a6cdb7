//! The one error of this crate.

use std::path::PathBuf;

use crate::finding::Finding;
use crate::value::ValueError;

/// Why a graph could not be read, set or evaluated.
#[derive(Debug, thiserror::Error)]
pub enum ProceduralError {
    /// A file could not be read.
    #[error("cannot read '{}': {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// A file is not a graph that can be evaluated.
    #[error("'{name}' is not a graph that can be evaluated: {}: {}", counted(findings.len()), findings[0])]
    Invalid {
        /// The file.
        name: String,
        /// Everything that was found; never empty.
        findings: Vec<Finding>,
    },
    /// A graph has no parameter of this name.
    #[error("'{graph}' has no parameter '{name}'; expected one of: {known}")]
    UnknownParameter {
        /// The graph.
        graph: String,
        /// The name.
        name: String,
        /// The names of the parameters, with commas between them.
        known: String,
    },
    /// A parameter that has a value of its own at every point.
    #[error("parameter '{name}' of '{graph}' cannot be set: it is the extent of a pixel at every point")]
    SetAtEveryPoint {
        /// The graph.
        graph: String,
        /// The parameter.
        name: String,
    },
    /// A text is not a value of the parameter's type.
    #[error("parameter '{name}' of '{graph}': {reason}")]
    BadValue {
        /// The graph.
        graph: String,
        /// The parameter.
        name: String,
        /// What was expected and what was found.
        reason: ValueError,
    },
    /// A value is out of the parameter's range.
    #[error("parameter '{name}' of '{graph}': expected {}, found {found}", range(*least, *most))]
    OutOfRange {
        /// The graph.
        graph: String,
        /// The parameter.
        name: String,
        /// The least value of the component, if it has one.
        least: Option<f64>,
        /// The greatest value of the component, if it has one.
        most: Option<f64>,
        /// The value.
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
    NotFinite {
        /// The graph.
        graph: String,
        /// The output.
        output: &'static str,
        /// The place.
        u: f64,
        /// The place.
        v: f64,
        /// The value.
        value: f64,
    },
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
