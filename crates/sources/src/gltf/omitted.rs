//! Features of a glTF that a scene cannot represent, counted by kind: one finding a kind, however often it occurs.

use std::collections::BTreeMap;

use mateval_scene::findings::shortened;

use crate::log::Log;

/// The features that were left out so far.
#[derive(Debug, Default)]
pub(super) struct Omitted {
    /// By code and kind: how often, and the JSON pointer of the first.
    kinds: BTreeMap<(Omission, String), (usize, String)>,
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
    /// Counts a feature at a JSON pointer. `kind` begins a sentence that ends in "not represented".
    pub(super) fn add(&mut self, omission: Omission, kind: &str, pointer: &str) {
        let first = || (0, pointer.to_owned());
        self.kinds.entry((omission, shortened(kind))).or_insert_with(first).0 += 1;
    }

    /// Reports every kind with its count.
    pub(super) fn report(self, log: &mut Log) {
        for ((omission, kind), (count, first)) in self.kinds {
            let times = if count == 1 { String::new() } else { format!(" ({count} times; the first is named)") };
            let message = format!("{kind}: not represented{times}");
            match omission {
                Omission::Visible => log.warn("not_represented", &first, message, "left it out"),
                Omission::Slight => log.note("not_represented", &first, message, "left it out"),
            }
        }
    }
}
