//! Parses JSON within limits on memory, and looks up values in it. Lookups treat a value of the wrong type as missing,
//! since the data has both.

use mateval_files::untrusted::{hint, without_mark};
use serde_json::Value;

use crate::source_scene::JsonSize;

/// Limits on an untrusted house, checked before memory is taken. A house that exceeds them is refused; a model or
/// texture that does is a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a house's JSON. The largest known house has a twentieth of it.
    pub json_bytes: u64,
    /// Values in the JSON: numbers, texts, lists, objects.
    pub json_values: usize,
    /// Lists and objects in the JSON, each of which takes more memory than a number.
    pub json_containers: usize,
    /// Bytes of any other file.
    pub file_bytes: u64,
    /// Triangles of all models and meshes.
    pub triangles: usize,
    /// Texels of all textures.
    pub texels: usize,
    pub rooms: usize,
    /// Children of all rooms.
    pub children: usize,
    /// Number of findings. Further ones are only counted.
    pub findings: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            json_bytes: 128 << 20,
            json_values: 16 << 20,
            json_containers: 1 << 20,
            file_bytes: 256 << 20,
            triangles: 20_000_000,
            texels: 512 << 20,
            rooms: 1_000,
            children: 50_000,
            findings: 5_000,
        }
    }
}

/// Why JSON is not that of a 3D-FRONT house, or exceeds a limit.
#[derive(Debug, thiserror::Error)]
pub enum HouseError {
    #[error("expected JSON: {reason}{hint}")]
    NotJson {
        reason: serde_json::Error,
        /// What the file is instead, and what to do; empty where that is not known.
        hint: String,
    },
    #[error("expected an object, found {found}")]
    NotAnObject { found: &'static str },
    /// The JSON holds more values than any file of the data.
    #[error(
        "expected at most {most_values} values and {most_containers} lists and objects, found {values} and {containers}"
    )]
    TooLarge { values: usize, containers: usize, most_values: usize, most_containers: usize },
    #[error("expected an object 'scene' with rooms, found none")]
    NoScene,
    #[error("/scene/room: expected at most {most} rooms, found {found}")]
    TooManyRooms { most: usize, found: usize },
    #[error("{place}: expected at most {most} children in all rooms together, found more")]
    TooManyChildren {
        /// JSON pointer to the room at which the limit is exceeded.
        place: String,
        most: usize,
    },
    #[error("{place}: expected at most {most} triangles in all meshes together, found more")]
    TooManyTriangles {
        /// JSON pointer to the mesh at which the limit is exceeded.
        place: String,
        most: usize,
    },
}

/// Parses an object. Fails where the text is not JSON, not an object, or exceeds `limits`.
pub(super) fn parse(text: &[u8], limits: &Limits) -> Result<Value, HouseError> {
    let tree = parse_any(text, limits)?;
    if tree.is_object() { Ok(tree) } else { Err(HouseError::NotAnObject { found: kind(&tree) }) }
}

/// Parses any JSON. Fails where the text is not JSON or exceeds `limits`.
pub(super) fn parse_any(text: &[u8], limits: &Limits) -> Result<Value, HouseError> {
    let text = without_mark(text);
    let JsonSize { values, containers } = JsonSize::of(text);
    if values > limits.json_values || containers > limits.json_containers {
        let (most_values, most_containers) = (limits.json_values, limits.json_containers);
        return Err(HouseError::TooLarge { values, containers, most_values, most_containers });
    }
    serde_json::from_slice(text).map_err(|reason| HouseError::NotJson { reason, hint: hint(text).into_owned() })
}

/// The type of a value, for messages.
pub(super) fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

/// Longer texts are treated as missing, since names are copied to everything that they name.
const LONGEST_TEXT: usize = 4096;

/// The trimmed text at `key`, unless it is empty or longer than [`LONGEST_TEXT`].
pub(super) fn text<'a>(from: &'a Value, key: &str) -> Option<&'a str> {
    from.get(key).and_then(Value::as_str).map(str::trim).filter(|text| (1..=LONGEST_TEXT).contains(&text.len()))
}

/// The list at `key`; empty where there is none.
pub(super) fn list<'a>(from: &'a Value, key: &str) -> &'a [Value] {
    from.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// The number that a value holds: a number, or a text of one, as two of twelve houses of a later release have.
pub(super) fn number(value: &Value) -> Option<f64> {
    let found = value.as_f64().or_else(|| value.as_str()?.trim().parse().ok());
    found.filter(|number| number.is_finite())
}

/// Exactly `N` finite numbers at `key`.
pub(super) fn numbers<const N: usize>(from: &Value, key: &str) -> Option<[f64; N]> {
    let all = from.get(key)?.as_array()?;
    let all: [&Value; N] = all.iter().collect::<Vec<_>>().try_into().ok()?;
    let values = all.map(|value| number(value).unwrap_or(f64::NAN));
    values.iter().all(|value| value.is_finite()).then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Limits {
        Limits { json_values: 10, json_containers: 3, ..Limits::default() }
    }

    #[test]
    fn large_json_is_refused_before_it_is_parsed() {
        assert!(parse(b"{\"a\": [1, 2, 3]}", &small()).is_ok());
        let many_values = parse(b"{\"a\": [1,2,3,4,5,6,7,8,9,10,11]}", &small());
        assert!(matches!(many_values, Err(HouseError::TooLarge { values: 11, containers: 2, .. })), "{many_values:?}");
        let many_lists = parse(b"{\"a\": [[], [], []]}", &small()).unwrap_err();
        assert!(many_lists.to_string().contains("at most 10 values and 3 lists"), "{many_lists}");
        // Brackets and commas within texts do not count.
        assert!(parse(br#"{"a": "[[[[[[{{{,,,,,,,,,,,,,,,, \" [[[ \\"}"#, &small()).is_ok());
    }

    #[test]
    fn other_texts_are_refused() {
        assert!(matches!(parse(b"[]", &small()), Err(HouseError::NotAnObject { found: "a list" })));
        assert!(matches!(parse(b"{", &small()), Err(HouseError::NotJson { .. })));
        let deep = "[".repeat(1000);
        assert!(matches!(parse(deep.as_bytes(), &Limits::default()), Err(HouseError::NotJson { .. })));
    }

    #[test]
    fn values_of_the_wrong_type_are_missing() {
        let value = serde_json::json!({"t": " x ", "e": "", "n": [1, 2.5], "bad": [1, null]});
        assert_eq!((text(&value, "t"), text(&value, "e"), text(&value, "n")), (Some("x"), None, None));
        let long = serde_json::json!({"t": "x".repeat(LONGEST_TEXT), "u": "x".repeat(LONGEST_TEXT + 1)});
        assert_eq!((text(&long, "t").map(str::len), text(&long, "u")), (Some(LONGEST_TEXT), None));
        assert_eq!(numbers::<2>(&value, "n"), Some([1.0, 2.5]));
        let texts = serde_json::json!({"n": ["1", " -2.5e0 "], "bad": ["1", "one"], "nan": ["1", "nan"]});
        assert_eq!(numbers::<2>(&texts, "n"), Some([1.0, -2.5]));
        assert_eq!((numbers::<2>(&texts, "bad"), numbers::<2>(&texts, "nan")), (None, None));
        assert_eq!((numbers::<3>(&value, "n"), numbers::<2>(&value, "bad")), (None, None));
        assert!(list(&value, "none").is_empty());
    }
}
