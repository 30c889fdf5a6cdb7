//! The rule for a method's name, which submissions state, and tables and boards show.

use mateval_scene::{Finding, Severity};

/// Longest name of a method, in characters.
const LONGEST: usize = 100;

/// What is wrong with the name of a method, as a finding about `file` without a place; none for a name that tables can
/// show.
pub fn check(name: &str, severity: Severity, file: &str) -> Option<Finding> {
    let finding = |code: &str, message: String, action: String| Finding {
        severity,
        code: code.to_owned(),
        file: file.to_owned(),
        place: String::new(),
        message,
        action,
    };
    if name.chars().all(|c| c.is_whitespace() || is_unprintable(c)) {
        let message = "the method has no name".to_owned();
        return Some(finding("no_method_name", message, "write the name that tables should show".to_owned()));
    }
    let (length, unprintable) = (name.chars().count(), name.chars().any(is_unprintable));
    (length > LONGEST || unprintable).then(|| {
        let unprintable = if unprintable { ", some of them unprintable" } else { "" };
        let message = format!("the method's name has {length} characters{unprintable}");
        finding("bad_method_name", message, format!("use at most {LONGEST} printable characters"))
    })
}

/// Whether the character shows nothing by itself: two names that differ only in such characters look the same, and those
/// that set the direction of writing reorder the text around the name.
fn is_unprintable(c: char) -> bool {
    let is_ignorable = matches!(c,
        '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' | '\u{180b}'..='\u{180f}'
        | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{3164}'
        | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}' | '\u{1d173}'..='\u{1d17a}'
        | '\u{e0000}'..='\u{e0fff}');
    c.is_control() || is_ignorable
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(name: &str) -> Option<String> {
        check(name, Severity::Warning, "submission.json").map(|finding| finding.code)
    }

    #[test]
    fn names_that_tables_cannot_show_are_found() {
        for name in ["", " \t", "\u{200b}", "\u{202e}\u{2066}", "\0"] {
            assert_eq!(code(name).as_deref(), Some("no_method_name"), "{name:?}");
        }
        let long = "x".repeat(LONGEST + 1);
        for name in ["a\nb", "a\0", "safe\u{202e}gpj", "a\u{2067}b", "a\u{200b}b", "a\u{2028}b", &long] {
            assert_eq!(code(name).as_deref(), Some("bad_method_name"), "{name:?}");
        }
        for name in ["MatEval <b>", "b_2 (ours)", "材料 é", &"x".repeat(LONGEST)] {
            assert_eq!(code(name), None, "{name:?}");
        }
    }
}
