//! What Mitsuba cannot say, gathered on the way.

use mateval_scene::{Finding, Severity};

/// The file that findings name.
pub(super) const SCENE_FILE: &str = "scene.xml";

/// Findings so far.
#[derive(Default)]
pub(super) struct Remarks(Vec<Finding>);

impl Remarks {
    /// The exported scene means something else here.
    pub(super) fn warn(&mut self, code: &str, place: &str, message: &str, action: &str) {
        self.add(Severity::Warning, code, place, message, action);
    }

    /// It means the same, or so nearly that only a very long render would tell.
    pub(super) fn note(&mut self, code: &str, place: &str, message: &str, action: &str) {
        self.add(Severity::Note, code, place, message, action);
    }

    /// All of them, sorted.
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
