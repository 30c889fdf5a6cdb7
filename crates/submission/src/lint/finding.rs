//! Findings by severity, made in one line of code each.

use mateval_scene::{Finding, Severity};

/// A fault that scoring refuses, or replaces by a default.
pub(super) fn error(code: &str, file: &str, message: impl Into<String>, action: impl Into<String>) -> Finding {
    finding(Severity::Error, code, file, message, action)
}

/// Something that is scored, but probably a mistake.
pub(super) fn warning(code: &str, file: &str, message: impl Into<String>, action: impl Into<String>) -> Finding {
    finding(Severity::Warning, code, file, message, action)
}

/// Something for information.
pub(super) fn note(code: &str, file: &str, message: impl Into<String>, action: impl Into<String>) -> Finding {
    finding(Severity::Note, code, file, message, action)
}

fn finding(
    severity: Severity,
    code: &str,
    file: &str,
    message: impl Into<String>,
    action: impl Into<String>,
) -> Finding {
    Finding {
        severity,
        code: code.to_owned(),
        file: file.to_owned(),
        place: String::new(),
        message: message.into(),
        action: action.into(),
    }
}
