//! Names that are made unique by a number.

use std::collections::{BTreeMap, BTreeSet};

/// The names given so far.
#[derive(Debug, Default)]
pub(crate) struct UniqueNames {
    taken: BTreeSet<String>,
    /// By name: the last number that was appended to it.
    numbers: BTreeMap<String, usize>,
}

impl UniqueNames {
    /// The name, with `-2`, `-3` and so on appended where it is taken.
    pub(crate) fn unique(&mut self, name: String) -> String {
        let mut unique = name.clone();
        while !self.taken.insert(unique.clone()) {
            let number = self.numbers.entry(name.clone()).or_insert(1);
            *number += 1;
            unique = format!("{name}-{number}");
        }
        unique
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_names_are_numbered() {
        let mut names = UniqueNames::default();
        let given = ["lamp", "lamp-2", "lamp", "lamp"].map(|name| names.unique(name.to_owned()));
        assert_eq!(given, ["lamp", "lamp-2", "lamp-3", "lamp-4"]);
    }
}
