//! What a reader collects while it makes a scene: findings, each once, and names, none twice.

use std::collections::{BTreeMap, BTreeSet};

use mateval_dataset::{Finding, Severity};

/// The findings of a scene that is being read, each once.
#[derive(Debug)]
pub(crate) struct Log {
    file: String,
    limit: usize,
    findings: BTreeSet<Finding>,
    dropped: usize,
}

impl Log {
    /// An empty log. Findings refer to `file` by default. Findings beyond `limit` are only counted.
    pub(crate) fn new(file: String, limit: usize) -> Self {
        Self { file, limit, findings: BTreeSet::new(), dropped: 0 }
    }

    /// The file that findings refer to by default.
    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// Reports that something was left out or replaced.
    pub(crate) fn warn(&mut self, code: &str, place: &str, message: impl Into<String>, action: impl Into<String>) {
        let file = self.file.clone();
        self.push(Severity::Warning, code, &file, place, message, action);
    }

    /// Reports that something was read differently from how it is written, without loss.
    pub(crate) fn note(&mut self, code: &str, place: &str, message: impl Into<String>, action: impl Into<String>) {
        let file = self.file.clone();
        self.push(Severity::Note, code, &file, place, message, action);
    }

    /// Reports a finding about another file.
    pub(crate) fn push(
        &mut self,
        severity: Severity,
        code: &str,
        file: &str,
        place: &str,
        message: impl Into<String>,
        action: impl Into<String>,
    ) {
        if self.findings.len() >= self.limit {
            self.dropped += 1;
            return;
        }
        self.findings.insert(Finding::new(severity, code, file, place, message, action));
    }

    pub(crate) fn into_findings(mut self) -> Vec<Finding> {
        if self.dropped > 0 {
            let (file, message) = (self.file.clone(), format!("{} findings are not listed", self.dropped));
            self.limit = usize::MAX;
            self.push(Severity::Warning, "too_many_findings", &file, "", message, "only counted them");
        }
        self.findings.into_iter().collect()
    }
}

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
    fn findings_are_sorted_unique_and_limited() {
        let mut log = Log::new("scene.xml".into(), 2);
        for code in ["b", "a", "b", "c", "d"] {
            log.warn(code, "", "message", "action");
        }
        let codes: Vec<_> = log.into_findings().into_iter().map(|f| f.code).collect();
        assert_eq!(codes, ["a", "b", "too_many_findings"]);
    }

    #[test]
    fn later_names_are_numbered() {
        let mut names = UniqueNames::default();
        let given = ["lamp", "lamp-2", "lamp", "lamp"].map(|name| names.unique(name.to_owned()));
        assert_eq!(given, ["lamp", "lamp-2", "lamp-3", "lamp-4"]);
    }
}
