//! Numbers and lists of numbers as Mitsuba writes them.

use super::document::Element;

/// One finite number; what was found instead otherwise.
pub(super) fn number(text: &str) -> Result<f64, String> {
    let trimmed = text.trim();
    let refused = || format!("expected a finite number, found '{}'", mateval_scene::findings::shortened(trimmed));
    trimmed.parse::<f64>().ok().filter(|n| n.is_finite()).ok_or_else(refused)
}

/// Finite numbers between commas or white space, at most 64.
pub(super) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    let list = words.take(65).map(number).collect::<Result<Vec<_>, _>>()?;
    if list.len() > 64 { Err("expected at most 64 numbers, found more".to_owned()) } else { Ok(list) }
}

/// Three numbers, or one for all three.
pub(super) fn triple(text: &str) -> Result<[f64; 3], String> {
    match numbers(text)?[..] {
        [one] => Ok([one; 3]),
        [a, b, c] => Ok([a, b, c]),
        ref other => Err(format!("expected 1 or 3 numbers, found {}", other.len())),
    }
}

/// The triple that an element holds as `value`, or as `x`, `y` and `z` of which any may be missing.
pub(super) fn vector(element: &Element, missing: f64) -> Result<[f64; 3], String> {
    if let Some(text) = element.attribute("value") {
        return triple(text);
    }
    let axis = |key| element.attribute(key).map_or(Ok(missing), number);
    Ok([axis("x")?, axis("y")?, axis("z")?])
}

/// `true` or `false`.
pub(super) fn boolean(text: &str) -> Result<bool, String> {
    match text.trim().to_ascii_lowercase().as_str() {
        "true" => Ok(true),
        "false" => Ok(false),
        other => Err(format!("expected true or false, found '{}'", mateval_scene::findings::shortened(other))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_all_spellings() {
        assert_eq!(number("-2.81996e-008").unwrap(), -2.81996e-8);
        assert_eq!(numbers("1, 2,3\n 4\t+5").unwrap(), [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(triple("0.5").unwrap(), [0.5; 3]);
        assert_eq!(triple("0.1 0.2 0.3").unwrap(), triple("0.1, 0.2, 0.3").unwrap());
    }

    #[test]
    fn what_is_not_a_finite_number_is_refused() {
        for bad in ["", "nan", "inf", "1e999", "0x1", "1.0f", "one"] {
            assert!(number(bad).is_err(), "{bad}");
        }
        assert!(triple("1 2").is_err() && triple("1 2 nan").is_err() && boolean("yes").is_err());
        assert!(numbers(&"1 ".repeat(1_000_000)).is_err());
    }
}
