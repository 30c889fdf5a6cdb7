//! Numbers as 3D-FRONT writes them.

use serde_json::{Value, json};

/// A number with at most five decimals. Whole numbers are written without a point, as in the data.
pub(super) fn number(value: f64) -> Value {
    let rounded = (value * 1e5).round() / 1e5;
    if rounded.fract() == 0.0 { json!(rounded as i64) } else { json!(rounded) }
}

/// A list of [`number`]s.
pub(super) fn numbers(values: impl IntoIterator<Item = f64>) -> Value {
    values.into_iter().map(number).collect()
}
