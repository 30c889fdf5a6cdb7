//! Numbers, lists of numbers and booleans as Mitsuba writes them.

use mateval_scene::findings::shortened;

use super::document::Element;
use super::error::ValueError;

/// The longest list of numbers that any value has, with room to spare.
const MOST_NUMBERS: usize = 64;

/// One finite number.
pub(super) fn number(text: &str) -> Result<f64, ValueError> {
    let trimmed = text.trim();
    let refused = || ValueError::NotANumber { found: shortened(trimmed) };
    trimmed.parse::<f64>().ok().filter(|n| n.is_finite()).ok_or_else(refused)
}

/// One number from `least` to `most`.
pub(super) fn number_within(text: &str, least: f64, most: f64) -> Result<f64, ValueError> {
    let found = number(text)?;
    if (least..=most).contains(&found) { Ok(found) } else { Err(ValueError::OutOfRange { least, most, found }) }
}

/// Finite numbers between commas or white space, at most [`MOST_NUMBERS`].
pub(super) fn numbers(text: &str) -> Result<Vec<f64>, ValueError> {
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    let list = words.take(MOST_NUMBERS + 1).map(number).collect::<Result<Vec<_>, _>>()?;
    if list.len() > MOST_NUMBERS { Err(ValueError::TooManyNumbers { most: MOST_NUMBERS }) } else { Ok(list) }
}

/// Three numbers, or one that stands for all three.
pub(super) fn triple(text: &str) -> Result<[f64; 3], ValueError> {
    match numbers(text)?[..] {
        [one] => Ok([one; 3]),
        [a, b, c] => Ok([a, b, c]),
        ref other => Err(ValueError::Count { expected: "1 or 3", found: other.len() }),
    }
}

/// The triple in the attribute `value` of an element, or in `x`, `y` and `z`, where an absent one counts as `missing`.
pub(super) fn vector(element: &Element, missing: f64) -> Result<[f64; 3], ValueError> {
    if let Some(text) = element.attribute("value") {
        return triple(text);
    }
    let axis = |key| element.attribute(key).map_or(Ok(missing), number);
    Ok([axis("x")?, axis("y")?, axis("z")?])
}

/// `true` or `false`.
pub(super) fn boolean(text: &str) -> Result<bool, ValueError> {
    match text.trim().to_ascii_lowercase().as_str() {
        "true" => Ok(true),
        "false" => Ok(false),
        other => Err(ValueError::NotABoolean { found: shortened(other) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_all_notations() {
        assert_eq!(number("-2.81996e-008").unwrap(), -2.81996e-8);
        assert_eq!(numbers("1, 2,3\n 4\t+5").unwrap(), [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(triple("0.5").unwrap(), [0.5; 3]);
        assert_eq!(triple("0.1 0.2 0.3").unwrap(), triple("0.1, 0.2, 0.3").unwrap());
    }

    #[test]
    fn other_texts_are_refused() {
        for bad in ["", "nan", "inf", "1e999", "0x1", "1.0f", "one"] {
            assert!(number(bad).is_err(), "{bad}");
        }
        assert!(triple("1 2").is_err() && triple("1 2 nan").is_err() && boolean("yes").is_err());
        assert!(numbers(&"1 ".repeat(1_000_000)).is_err());
    }
}
