//! Parses JSON within limits on memory, and looks up values in it. Lookups treat a value of the wrong type as missing,
//! since the data has both.

use std::borrow::Cow;

use mateval_files::untrusted::{hint, without_mark};
use serde_json::Value;

use crate::open::{Invalid, check_json};

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

/// Parses an object. Fails where the text is not JSON, not an object, or exceeds `limits`.
pub(super) fn parse(text: &[u8], limits: &Limits) -> Result<Value, Invalid> {
    let tree = parse_any(text, limits)?;
    if tree.is_object() { Ok(tree) } else { Err(Invalid(format!("expected an object, found {}", kind(&tree)))) }
}

/// Parses any JSON. Fails where the text is not JSON or exceeds `limits`.
pub(super) fn parse_any(text: &[u8], limits: &Limits) -> Result<Value, Invalid> {
    let text = without_mark(text);
    // As in glTF, the file may be padded with NUL.
    let text = &text[..text.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1)];
    check_json(text, limits.json_values, limits.json_containers)?;
    serde_json::from_slice(text).map_err(|reason| Invalid(format!("expected JSON: {reason}{}", hint(text))))
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

/// The id at `key`: a text, or a whole number, which stands for its digits.
pub(super) fn id_of<'a>(from: &'a Value, key: &str) -> Option<Cow<'a, str>> {
    let number = || from.get(key).and_then(Value::as_u64).map(|number| Cow::Owned(number.to_string()));
    text(from, key).map(Cow::Borrowed).or_else(number)
}

/// The truth value that a value holds: true or false, or 1 or 0, or a text of one of them.
pub(super) fn boolean(value: &Value) -> Option<bool> {
    match value {
        Value::Bool(found) => Some(*found),
        Value::String(text) if text.trim().eq_ignore_ascii_case("true") => Some(true),
        Value::String(text) if text.trim().eq_ignore_ascii_case("false") => Some(false),
        other => number(other).filter(|number| [0.0, 1.0].contains(number)).map(|number| number == 1.0),
    }
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
        for (many, found) in [("[1,2,3,4,5,6,7,8,9,10,11]", "found 11 and 2"), ("[[], [], []]", "found 3 and 5")] {
            let error = parse(format!("{{\"a\": {many}}}").as_bytes(), &small()).unwrap_err().to_string();
            assert!(error.contains("at most 10 values and 3 lists") && error.contains(found), "{error}");
        }
        // Brackets and commas within texts do not count.
        assert!(parse(br#"{"a": "[[[[[[{{{,,,,,,,,,,,,,,,, \" [[[ \\"}"#, &small()).is_ok());
    }

    #[test]
    fn ids_and_truth_values_may_have_other_types() {
        let value = serde_json::json!({"a": 7, "b": " 7 ", "c": 7.5, "d": [7]});
        assert_eq!(
            ["a", "b", "c", "d", "e"].map(|key| id_of(&value, key)),
            [Some("7"), Some("7"), None, None, None].map(|id| id.map(Cow::from))
        );
        let of = |value: Value| boolean(&value);
        for value in [serde_json::json!(true), serde_json::json!("True"), serde_json::json!(1), serde_json::json!("1")]
        {
            assert_eq!(of(value), Some(true));
        }
        for value in [serde_json::json!(false), serde_json::json!("FALSE "), serde_json::json!(0.0)] {
            assert_eq!(of(value), Some(false));
        }
        for value in
            [serde_json::json!("yes"), serde_json::json!(2), serde_json::json!(null), serde_json::json!([true])]
        {
            assert_eq!(of(value), None);
        }
    }

    #[test]
    fn padding_is_skipped() {
        assert!(parse(b"\xef\xbb\xbf{}\n\0\0", &small()).is_ok());
        assert!(parse(b"\0\0", &small()).is_err());
    }

    #[test]
    fn other_texts_are_refused() {
        let deep = "[".repeat(1000);
        for (text, words) in [("[]", "found a list"), ("{", "expected JSON"), (&deep, "expected JSON")] {
            let error = parse(text.as_bytes(), &Limits::default()).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
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
