//! A house's JSON as a tree, refused before it takes more memory than its file can justify; and lookups in it that
//! forgive every missing or odd key, since each was seen missing or odd.

use serde_json::Value;

use super::limits::Limits;

/// The tree. Fails, in words, where the text is no JSON, no object, or holds more than `limits` allow.
pub(super) fn parse(text: &[u8], limits: &Limits) -> Result<Value, String> {
    check_size(text, limits)?;
    let tree: Value = serde_json::from_slice(text).map_err(|error| format!("not JSON: {error}"))?;
    if tree.is_object() { Ok(tree) } else { Err(format!("expected an object, found {}", kind(&tree))) }
}

/// Counts what a tree of the text would hold: two bytes of text can cost a hundred of memory.
pub(super) fn check_size(text: &[u8], limits: &Limits) -> Result<(), String> {
    let (mut values, mut containers, mut in_text, mut escaped) = (0_usize, 0_usize, false, false);
    for byte in text {
        if in_text {
            in_text = escaped || *byte != b'"';
            escaped = !escaped && *byte == b'\\';
            continue;
        }
        match byte {
            b'"' => in_text = true,
            b',' | b':' => values += 1,
            b'[' | b'{' => containers += 1,
            _ => {}
        }
    }
    if values > limits.json_values || containers > limits.json_containers {
        return Err(format!(
            "expected at most {} values and {} lists and objects, found {values} and {containers}: no file of the data is that large",
            limits.json_values, limits.json_containers
        ));
    }
    Ok(())
}

/// What a value is, in words.
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

/// Longer texts are none: names are copied to each thing that they name.
const LONGEST_TEXT: usize = 4096;

/// The text at `key`, unless it is empty, absurdly long or no text.
pub(super) fn text<'a>(from: &'a Value, key: &str) -> Option<&'a str> {
    from.get(key).and_then(Value::as_str).map(str::trim).filter(|text| (1..=LONGEST_TEXT).contains(&text.len()))
}

/// The list at `key`; empty where there is none.
pub(super) fn list<'a>(from: &'a Value, key: &str) -> &'a [Value] {
    from.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// Exactly `N` finite numbers at `key`.
pub(super) fn numbers<const N: usize>(from: &Value, key: &str) -> Option<[f64; N]> {
    let all = from.get(key)?.as_array()?;
    let all: [&Value; N] = all.iter().collect::<Vec<_>>().try_into().ok()?;
    let values = all.map(|value| value.as_f64().unwrap_or(f64::NAN));
    values.iter().all(|value| value.is_finite()).then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Limits {
        Limits { json_values: 10, json_containers: 3, ..Limits::default() }
    }

    #[test]
    fn what_is_too_much_is_refused_before_it_is_read() {
        assert!(parse(b"{\"a\": [1, 2, 3]}", &small()).is_ok());
        assert!(parse(b"{\"a\": [1,2,3,4,5,6,7,8,9,10,11]}", &small()).unwrap_err().contains("at most 10 values"));
        assert!(parse(b"{\"a\": [[], [], []]}", &small()).unwrap_err().contains("at most 10 values and 3 lists"));
        // What stands in a text does not count.
        assert!(parse(br#"{"a": "[[[[[[{{{,,,,,,,,,,,,,,,, \" [[[ \\"}"#, &small()).is_ok());
    }

    #[test]
    fn what_is_no_house_is_told() {
        assert!(parse(b"[]", &small()).unwrap_err().contains("found a list"));
        assert!(parse(b"{", &small()).unwrap_err().contains("not JSON"));
        assert!(parse("[".repeat(1000).as_bytes(), &Limits::default()).unwrap_err().contains("not JSON"));
    }

    #[test]
    fn lookups_forgive() {
        let value = serde_json::json!({"t": " x ", "e": "", "n": [1, 2.5], "bad": [1, null]});
        assert_eq!((text(&value, "t"), text(&value, "e"), text(&value, "n")), (Some("x"), None, None));
        let long = serde_json::json!({"t": "x".repeat(LONGEST_TEXT), "u": "x".repeat(LONGEST_TEXT + 1)});
        assert_eq!((text(&long, "t").map(str::len), text(&long, "u")), (Some(LONGEST_TEXT), None));
        assert_eq!(numbers::<2>(&value, "n"), Some([1.0, 2.5]));
        assert_eq!((numbers::<3>(&value, "n"), numbers::<2>(&value, "bad")), (None, None));
        assert!(list(&value, "none").is_empty());
    }
}
