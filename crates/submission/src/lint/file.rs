//! The report of `eval lint`: type of its JSON.

use mateval_scene::{Finding, Severity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mateval_scene::dataset_id::DatasetId;

/// The word for this version of a report.
pub const LINT_FORMAT: &str = "mateval-lint/1";

/// What `eval lint` found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LintFile {
    /// Always `mateval-lint/1`.
    pub format: String,
    /// Program and version.
    pub tool: String,
    /// From `submission.json`; null where that does not say.
    pub method: Option<String>,
    /// What the submission was held against.
    pub dataset: DatasetId,
    /// Whether there is no error.
    pub good: bool,
    /// Files of maps that could be read.
    pub maps: usize,
    /// How many errors there are, repeats counted.
    pub errors: usize,
    /// How many warnings there are.
    pub warnings: usize,
    /// How many notes there are.
    pub notes: usize,
    /// By severity and code.
    pub findings: Vec<FoldedFinding>,
}

/// All findings of one code.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FoldedFinding {
    /// Of all of them.
    pub severity: Severity,
    /// The code.
    pub code: String,
    /// How many there are.
    pub count: usize,
    /// The first of them, 100 at most, sorted by file and place.
    pub examples: Vec<Finding>,
}

impl LintFile {
    /// Counts.
    pub(super) fn new(
        tool: String,
        method: Option<String>,
        dataset: DatasetId,
        maps: usize,
        findings: Vec<FoldedFinding>,
    ) -> Self {
        let count = |severity: Severity| {
            findings.iter().filter(|finding| finding.severity == severity).map(|finding| finding.count).sum()
        };
        let errors = count(Severity::Error);
        Self {
            format: LINT_FORMAT.to_owned(),
            tool,
            method,
            dataset,
            good: errors == 0,
            maps,
            errors,
            warnings: count(Severity::Warning),
            notes: count(Severity::Note),
            findings,
        }
    }
}
