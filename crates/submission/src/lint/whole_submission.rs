//! A whole submission checked: its folder, `submission.json`, then scene by scene.

use mateval_scene::dataset_id::DatasetId;
use mateval_scene::open::Dataset;
use mateval_scene::{Finding, Progress, Report};

use super::file::LintFile;
use super::plan::LintPlan;
use super::tree::Tree;
use super::{colours, fold, layout, readings, scene, submission_json};
use crate::error::SubmissionError;

/// Checks a submission. Fails where its folder or the dataset's public files cannot be read.
pub fn lint(plan: &LintPlan<'_>, progress: Progress<'_>) -> Result<LintFile, SubmissionError> {
    let (tree, mut findings) = Tree::walk(plan.submission)?;
    if let Some(nested) = layout::nested(&tree) {
        return Ok(report(plan.dataset, &plan.tool, None, 0, vec![nested]));
    }
    let (method, of_json) = submission_json::check(plan.submission, &plan.dataset.file.manifest_sha256);
    findings.extend(of_json);
    findings.extend(layout::check(plan.dataset, &tree));
    if let Some(absence) = plan.dataset.absence() {
        progress(Report::Message(&absence));
    }
    let scenes = &plan.dataset.scenes;
    let mut maps = 0;
    let (mut decodings, mut all_readings) = (Vec::new(), Vec::new());
    for (at, scene) in scenes.iter().enumerate() {
        progress(Report::part("scenes checked", at, scenes.len()));
        let found = scene::check(plan, scene)?;
        findings.extend(found.findings);
        decodings.push(found.decoding);
        all_readings.push(found.readings);
        maps += found.maps;
    }
    let wrong = colours::mostly_wrong(decodings);
    if wrong.is_empty() {
        // Findings by hue are more precise: they name the kind of file that is wrong.
        findings.extend(readings::check(&all_readings));
    }
    findings.extend(wrong);
    progress(Report::part("scenes checked", scenes.len(), scenes.len()));
    Ok(report(plan.dataset, &plan.tool, method, maps, findings))
}

/// The report on an archive that was refused for these reasons.
pub fn refused(dataset: &Dataset, tool: &str, findings: Vec<Finding>) -> LintFile {
    report(dataset, tool, None, 0, findings)
}

fn report(dataset: &Dataset, tool: &str, method: Option<String>, maps: usize, findings: Vec<Finding>) -> LintFile {
    let id = DatasetId::new(dataset, &dataset.scenes);
    LintFile::new(tool.to_owned(), method, id, maps, fold::folded(findings))
}
