//! The whole numbers that select what a node does: octaves, styles, components, sets of texture coordinates.

use crate::graph::{Parameter, Source};
use crate::limits::MOST_OCTAVES;
use crate::node::kind::Kind;
use crate::node::signature::Signature;

/// Why an integer input is not usable. Octaves and styles may be parameters whose range fits; what selects a component
/// must be a constant.
pub(super) fn fault(
    kind: Kind,
    signature: &Signature,
    input: &str,
    source: &Source,
    parameters: &[Parameter],
) -> Option<String> {
    let (most, may_vary) = match kind {
        Kind::Fractal2d => (f64::from(MOST_OCTAVES), true),
        Kind::WorleyNoise2d => (1.0, true),
        Kind::Extract => (signature.inputs[0].kind.width() as f64 - 1.0, false),
        // Only the first set of texture coordinates is evaluated.
        Kind::Texcoord => (0.0, false),
        _ => return None,
    };
    let (least_found, most_found) = match source {
        Source::Unset => return None,
        Source::Value(value) => (value.numbers()[0], value.numbers()[0]),
        Source::Parameter(at) if may_vary => range(&parameters[*at]),
        Source::Parameter(_) | Source::Node { .. } => return Some(format!("{input}: expected a constant")),
    };
    let fits = least_found >= 0.0 && most_found <= most;
    (!fits).then(|| format!("{input}: expected {}, found {}", span(0.0, most), span(least_found, most_found)))
}

/// A range in words; one number where the ends are the same.
fn span(least: f64, most: f64) -> String {
    if least == most { least.to_string() } else { format!("{least} to {most}") }
}

/// The range of a parameter; without end where none is given.
fn range(parameter: &Parameter) -> (f64, f64) {
    let number = |value: Option<crate::value::Value>, otherwise| value.map_or(otherwise, |value| value.numbers()[0]);
    (number(parameter.least, f64::NEG_INFINITY), number(parameter.most, f64::INFINITY))
}
