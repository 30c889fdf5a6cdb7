//! The inputs of `eval lint`.

use std::path::Path;

use mateval_scene::open::Dataset;

/// A submission to check, and the dataset that it answers.
pub struct LintPlan<'a> {
    /// The dataset that the submission was made for; its ground truth is not needed.
    pub dataset: &'a Dataset,
    /// The submission's folder.
    pub submission: &'a Path,
    /// Name and version of the tool, for the report.
    pub tool: String,
}
