//! The report of `eval lint`: type of its JSON.

use mateval_scene::{Finding, Severity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mateval_scene::dataset_id::DatasetId;

/// The name of this version of a report.
pub const LINT_FORMAT: &str = "mateval-lint/1";

/// What `eval lint` found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LintFile {
    /// Always `mateval-lint/1`.
    pub format: String,
    /// Program and version.
    pub tool: String,
    /// The method's name from `submission.json`; null where that has none.
    pub method: Option<String>,
    /// The dataset that the submission was checked against.
    pub dataset: DatasetId,
    /// Whether no error was found.
    pub good: bool,
    /// How many maps could be decoded.
    pub maps: usize,
    /// How many errors were found, repeats included.
    pub errors: usize,
    /// How many warnings were found, repeats included.
    pub warnings: usize,
    /// How many notes were found, repeats included.
    pub notes: usize,
    /// Sorted by severity and code.
    pub findings: Vec<FoldedFinding>,
}

/// All findings of one code.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FoldedFinding {
    /// Their severity.
    pub severity: Severity,
    /// Their code.
    pub code: String,
    /// How many were found.
    pub count: usize,
    /// The first of them, at most 100, sorted by file and place.
    pub examples: Vec<Finding>,
}

impl LintFile {
    /// A report with its counts.
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
