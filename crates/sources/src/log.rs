//! Collects findings while a scene is read.

use std::collections::BTreeSet;

use mateval_scene::{Finding, Severity};

/// The findings so far, each once.
#[derive(Debug)]
pub struct Log {
    file: String,
    limit: usize,
    findings: BTreeSet<Finding>,
    dropped: usize,
}

impl Log {
    /// An empty log. Findings refer to `file` by default. Findings beyond `limit` are only counted.
    pub fn new(file: String, limit: usize) -> Self {
        Self { file, limit, findings: BTreeSet::new(), dropped: 0 }
    }

    /// The file that findings refer to by default.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Reports that something was left out or replaced.
    pub fn warn(&mut self, code: &str, place: &str, message: impl Into<String>, action: impl Into<String>) {
        let file = self.file.clone();
        self.push(Severity::Warning, code, &file, place, message, action);
    }

    /// Reports that something was read differently from how it is written, without loss.
    pub fn note(&mut self, code: &str, place: &str, message: impl Into<String>, action: impl Into<String>) {
        let file = self.file.clone();
        self.push(Severity::Note, code, &file, place, message, action);
    }

    /// Reports a finding about another file.
    pub fn push(
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
        self.findings.insert(Finding {
            severity,
            code: code.to_owned(),
            file: file.to_owned(),
            place: place.to_owned(),
            message: message.into(),
            action: action.into(),
        });
    }

    /// All findings, sorted.
    pub fn into_findings(mut self) -> Vec<Finding> {
        if self.dropped > 0 {
            let (file, message) = (self.file.clone(), format!("{} findings are not listed", self.dropped));
            self.limit = usize::MAX;
            self.push(Severity::Warning, "too_many_findings", &file, "", message, "only counted them");
        }
        self.findings.into_iter().collect()
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
}
