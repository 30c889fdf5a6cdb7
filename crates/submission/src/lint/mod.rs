//! A submission looked over before it is scored: every fault at once, in seconds, without a render.
//!
//! In: a submission's folder and the public part of a dataset. Out: a [`LintFile`]: findings, folded, and a verdict.
//!
//! Between: `tree` lists the folder, `submission_json` and `layout` hold names against the dataset, `map_remarks`
//! tells what a sound file says that it should not. What the maps show is held against the input picture: `sight`
//! says where the picture shows which texel, `looks` what the maps have there; `orientation`, `colours`,
//! `shading`, `scalars`, `unobserved` and `copies` judge. An error is what scoring replaces or refuses; a warning
//! is what is scored and is probably a mistake; a note is for information. What only the pictures tell is never an
//! error: the evidence is in the message.

mod colours;
mod copies;
mod file;
mod finding;
mod fold;
mod layout;
mod looks;
mod map_remarks;
mod names;
mod orientation;
mod scalars;
mod scene;
mod shading;
mod sight;
mod statistics;
pub mod submission_json;
mod text;
mod tree;
mod unobserved;

use std::path::Path;

use mateval_scene::open::Dataset;
use mateval_scene::{Finding, Progress};

pub use file::{FoldedFinding, LINT_FORMAT, LintFile};
pub use text::plain;

use crate::error::SubmissionError;
use mateval_scene::dataset_id::DatasetId;
use tree::Tree;

/// What to look over.
pub struct LintPlan<'a> {
    /// What the submission is for; its ground truth is not needed.
    pub dataset: &'a Dataset,
    /// The submission's folder.
    pub submission: &'a Path,
    /// Name and version of the tool, for the report.
    pub tool: String,
}

/// Looks over a submission. Fails where its folder or the dataset's public files cannot be read.
pub fn lint(plan: &LintPlan<'_>, progress: Progress<'_>) -> Result<LintFile, SubmissionError> {
    let (tree, mut findings) = Tree::walk(plan.submission)?;
    if let Some(nested) = layout::nested(&tree) {
        return Ok(report(plan.dataset, &plan.tool, None, 0, vec![nested]));
    }
    let (method, of_json) = submission_json::check(plan.submission, &plan.dataset.file.manifest_sha256);
    findings.extend(of_json);
    findings.extend(layout::check(plan.dataset, &tree));
    let scenes = &plan.dataset.scenes;
    let mut maps = 0;
    let mut decodings = Vec::new();
    for (at, scene) in scenes.iter().enumerate() {
        progress("scenes looked over", at, scenes.len());
        let found = scene::check(plan, scene)?;
        findings.extend(found.findings);
        decodings.push(found.decoding);
        maps += found.maps;
    }
    findings.extend(colours::mostly_wrong(decodings));
    progress("scenes looked over", scenes.len(), scenes.len());
    Ok(report(plan.dataset, &plan.tool, method, maps, findings))
}

/// The report on an archive that was not unpacked, for these reasons.
pub fn refused(dataset: &Dataset, tool: &str, findings: Vec<Finding>) -> LintFile {
    report(dataset, tool, None, 0, findings)
}

fn report(dataset: &Dataset, tool: &str, method: Option<String>, maps: usize, findings: Vec<Finding>) -> LintFile {
    let id = DatasetId::new(dataset, &dataset.scenes);
    LintFile::new(tool.to_owned(), method, id, maps, fold::folded(findings))
}
