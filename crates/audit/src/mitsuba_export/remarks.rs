//! Collects findings about what Mitsuba cannot express.

use mateval_scene::{Finding, Severity};

/// The name of the exported scene's file, which all findings refer to.
pub(super) const SCENE_FILE: &str = "scene.xml";

/// The findings so far.
#[derive(Default)]
pub(super) struct Remarks(Vec<Finding>);

impl Remarks {
    /// Adds a warning: this part of the exported scene means something else in Mitsuba.
    pub(super) fn warn(&mut self, code: &str, place: &str, message: &str, action: &str) {
        self.add(Severity::Warning, code, place, message, action);
    }

    /// Adds a note: this part means the same in Mitsuba, or differs so little that only a very long render would show it.
    pub(super) fn note(&mut self, code: &str, place: &str, message: &str, action: &str) {
        self.add(Severity::Note, code, place, message, action);
    }

    /// All findings, sorted and without duplicates.
    pub(super) fn sorted(mut self) -> Vec<Finding> {
        self.0.sort();
        self.0.dedup();
        self.0
    }

    fn add(&mut self, severity: Severity, code: &str, place: &str, message: &str, action: &str) {
        self.0.push(Finding {
            severity,
            code: code.to_owned(),
            file: SCENE_FILE.to_owned(),
            place: place.to_owned(),
            message: message.to_owned(),
            action: action.to_owned(),
        });
    }
}
