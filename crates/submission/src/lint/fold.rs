//! Repeated findings folded: one entry for each code.

use mateval_scene::Finding;

use super::file::FoldedFinding;

/// Most examples kept for one code.
const MAX_EXAMPLES: usize = 100;

/// Folds findings; sorted by severity and code.
pub(super) fn folded(mut findings: Vec<Finding>) -> Vec<FoldedFinding> {
    findings.sort();
    findings.dedup();
    let same = |a: &Finding, b: &Finding| (a.severity, &a.code) == (b.severity, &b.code);
    findings
        .chunk_by(same)
        .map(|all| FoldedFinding {
            severity: all[0].severity,
            code: all[0].code.clone(),
            count: all.len(),
            examples: all.iter().take(MAX_EXAMPLES).cloned().collect(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lint::finding::{error, note};

    #[test]
    fn findings_fold_by_code_errors_first() {
        let many = (0..150).map(|at| error("nan", &format!("{at:03}"), "", ""));
        let folded = folded(std::iter::once(note("extra_file", "a", "", "")).chain(many).collect());
        let counts: Vec<(&str, usize, usize)> =
            folded.iter().map(|found| (found.code.as_str(), found.count, found.examples.len())).collect();
        assert_eq!(counts, [("nan", 150, 100), ("extra_file", 1, 1)]);
        assert_eq!(folded[0].examples[0].file, "000");
    }
}
