//! Features of a glTF that a scene cannot represent, counted by kind: one finding a kind, however often it occurs.

use std::collections::BTreeMap;

use crate::log::Log;

/// What is done with most features that cannot be represented.
pub(super) const LEFT_OUT: &str = "left it out";

/// The features that were left out so far.
#[derive(Debug, Default)]
pub(super) struct Omitted {
    kinds: BTreeMap<(Omission, String), Occurrences>,
}

/// The occurrences of one kind of feature.
#[derive(Debug)]
struct Occurrences {
    count: usize,
    /// The JSON pointer of the first.
    first: String,
    /// What was done instead.
    action: String,
}

/// Whether leaving a feature out changes how the scene looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Omission {
    /// It does: a warning.
    Visible,
    /// It does not, or hardly: a note.
    Slight,
}

impl Omitted {
    /// Counts a feature at a JSON pointer. `feature` begins a sentence that ends in "not represented", and `action`
    /// states what is done instead.
    pub(super) fn add(&mut self, omission: Omission, feature: &str, action: &str, pointer: &str) {
        let first = || Occurrences { count: 0, first: pointer.to_owned(), action: action.to_owned() };
        self.kinds.entry((omission, feature.to_owned())).or_insert_with(first).count += 1;
    }

    /// Reports every kind with its count.
    pub(super) fn report(self, log: &mut Log) {
        for ((omission, feature), Occurrences { count, first, action }) in self.kinds {
            let times = if count == 1 { String::new() } else { format!(" ({count} times; the first is named)") };
            let message = format!("{feature}: not represented{times}");
            match omission {
                Omission::Visible => log.warn("not_represented", &first, message, action),
                Omission::Slight => log.note("not_represented", &first, message, action),
            }
        }
    }
}
