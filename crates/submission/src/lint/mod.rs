//! A submission checked before it is scored: every fault at once, in seconds, without a render.
//!
//! In: a submission's folder and the public part of a dataset. Out: a [`LintFile`] with findings, folded by code, and a
//! verdict.
//!
//! Between: `folder` lists the folder and compares its names with the dataset's, [`submission_json`] checks that file,
//! and `scene` reads the maps of one scene. `map_headers` judges their headers. `sight` finds which texel each pixel of
//! the input picture shows and what the maps hold there; `base_colours` and `scene` judge that.
//!
//! An error is something that scoring refuses or replaces by a default. A warning is scored, but probably a mistake. A
//! note is for information. Evidence from pictures is never an error; the message states it.
//!
//! A new finding belongs into the file of its concept, with a row in format/submission.md and one in the table of
//! planted faults (`tests/suite/lint.rs`). A new concept is also called in `scene`.

mod base_colours;
mod folder;
mod map_headers;
mod scene;
mod sight;
pub mod submission_json;

use std::fmt::Write as _;
use std::path::Path;

use mateval_dataset::ids::counted;
use mateval_dataset::open::{Dataset, DatasetId};
use mateval_dataset::{Finding, Progress, Report, Severity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::SubmissionError;

/// The name of this version of a report.
pub const LINT_FORMAT: &str = "mateval-lint/1";

/// Most examples kept for one code.
const MAX_EXAMPLES: usize = 100;
/// How many further files are named after the first.
const PLACES: usize = 3;

/// A submission to check, and the dataset that it answers.
pub struct LintPlan<'a> {
    /// The dataset that the submission was made for; its ground truth is not needed.
    pub dataset: &'a Dataset,
    pub submission: &'a Path,
    /// Name and version of the tool, for the report.
    pub tool: String,
}

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

/// Checks a submission. Fails where its folder or the dataset's public files cannot be read.
pub fn lint(plan: &LintPlan<'_>, progress: Progress<'_>) -> Result<LintFile, SubmissionError> {
    let (tree, mut findings) = folder::Tree::walk(plan.submission)?;
    if let Some(nested) = folder::nested(&tree) {
        return Ok(refused(plan.dataset, &plan.tool, vec![nested]));
    }
    let (method, of_json) = submission_json::check(plan.submission, &plan.dataset.file.manifest_sha256);
    findings.extend(of_json);
    findings.extend(folder::check(plan.dataset, &tree));
    if let Some(absence) = plan.dataset.absence() {
        progress(Report::Message(&absence));
    }
    let scenes = &plan.dataset.scenes;
    let mut maps = 0;
    let (mut decodings, mut all_readings) = (Vec::new(), Vec::new());
    for (at, scene) in scenes.iter().enumerate() {
        progress(Report::part("scenes checked", at, scenes.len()));
        let found = scene::check(plan.dataset, plan.submission, scene)?;
        findings.extend(found.findings);
        decodings.push(found.decoding);
        all_readings.push(found.readings);
        maps += found.maps;
    }
    let wrong = base_colours::mostly_wrong(decodings);
    if wrong.is_empty() {
        // Findings by hue are more precise: they name the kind of file that is wrong.
        findings.extend(base_colours::untypical_encoding(&all_readings));
    }
    findings.extend(wrong);
    progress(Report::part("scenes checked", scenes.len(), scenes.len()));
    let dataset = DatasetId::new(plan.dataset, scenes);
    Ok(LintFile::new(&plan.tool, method, dataset, maps, findings))
}

/// The report on an archive that was refused for these reasons.
pub fn refused(dataset: &Dataset, tool: &str, findings: Vec<Finding>) -> LintFile {
    LintFile::new(tool, None, DatasetId::new(dataset, &dataset.scenes), 0, findings)
}

impl LintFile {
    fn new(tool: &str, method: Option<String>, dataset: DatasetId, maps: usize, findings: Vec<Finding>) -> Self {
        let findings = folded(findings);
        let count = |severity: Severity| {
            findings.iter().filter(|finding| finding.severity == severity).map(|finding| finding.count).sum()
        };
        let [errors, warnings, notes] = [Severity::Error, Severity::Warning, Severity::Note].map(count);
        let (format, tool, good) = (LINT_FORMAT.to_owned(), tool.to_owned(), errors == 0);
        Self { format, tool, method, dataset, good, maps, errors, warnings, notes, findings }
    }
}

/// Folds findings; sorted by severity and code.
fn folded(mut findings: Vec<Finding>) -> Vec<FoldedFinding> {
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

/// Findings, errors first, then the verdict in one line.
pub fn plain(file: &LintFile) -> String {
    let mut text = String::new();
    for finding in &file.findings {
        line(&mut text, finding);
    }
    let verdict = if file.good { "good" } else { "not good" };
    let found =
        [(file.errors, "error"), (file.warnings, "warning"), (file.notes, "note")].map(|(n, word)| counted(n, word));
    // Writing to a String cannot fail.
    let _ = writeln!(text, "{verdict}: {}, {}, {}; {} read", found[0], found[1], found[2], counted(file.maps, "map"));
    text
}

fn line(text: &mut String, finding: &FoldedFinding) {
    let Some((first, others)) = finding.examples.split_first() else { return };
    let _ = write!(text, "{first}");
    if finding.count > 1 {
        let more: Vec<String> = others.iter().take(PLACES).map(|other| format!("'{}'", other.file)).collect();
        let rest = if finding.count > 1 + more.len() { ", ..." } else { "" };
        let _ = write!(text, " ({} times; also {}{rest})", finding.count, more.join(", "));
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::{error, note, warning};

    #[test]
    fn findings_fold_by_code_errors_first() {
        let many = (0..150).map(|at| error("nan", &format!("{at:03}"), "", ""));
        let folded = folded(std::iter::once(note("extra_file", "a", "", "")).chain(many).collect());
        let counts: Vec<(&str, usize, usize)> =
            folded.iter().map(|found| (found.code.as_str(), found.count, found.examples.len())).collect();
        assert_eq!(counts, [("nan", 150, 100), ("extra_file", 1, 1)]);
        assert_eq!(folded[0].examples[0].file, "000");
    }

    #[test]
    fn repeats_take_one_line() {
        let mut findings: Vec<_> = (0..6).map(|at| error("nan", &format!("f{at}"), "a NaN", "fix it")).collect();
        findings.push(warning("alpha", "g", "opacity", "drop it"));
        let dataset = DatasetId {
            name: String::new(),
            version: String::new(),
            manifest_sha256: String::new(),
            scenes: Vec::new(),
            total_scenes: 0,
            sources: Default::default(),
            houses: Default::default(),
            wide_views: Default::default(),
            photo_renderer: None,
            withheld: None,
        };
        let text = plain(&LintFile::new("", None, dataset, 1, findings));
        let expected = "error [nan] 'f0': a NaN; fix it (6 times; also 'f1', 'f2', 'f3', ...)\n\
                        warning [alpha] 'g': opacity; drop it\n\
                        not good: 6 errors, 1 warning, 0 notes; 1 map read\n";
        assert_eq!(text, expected);
    }
}
