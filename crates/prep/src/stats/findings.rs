//! Sums up what was found in the sources of many scenes, by code and by scene: thousands of findings are of a few kinds.

use std::collections::BTreeMap;

use mateval_dataset::dataset::{DatasetVersion, SceneFile};
use mateval_dataset::ids::counted;
use mateval_dataset::open::Dataset;
use mateval_dataset::progress::{Table, row};
use mateval_dataset::{Finding, FindingCount, SceneId, Severity};
use mateval_files::untrusted::shown;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The value of `format` in this version of the file.
pub const FINDINGS_FORMAT: &str = "mateval-findings/1";

/// What `mateval prep stats --findings --format json` prints: the findings of all scenes, summed up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FindingsFile {
    /// Always `mateval-findings/1`.
    pub format: String,
    /// The program that counted and its version, as in `mateval 0.1.0`.
    pub tool: String,
    /// The dataset.
    pub dataset: DatasetVersion,
    /// The kinds of findings, by severity, then the most frequent first.
    pub codes: Vec<FoundCode>,
    /// The scenes with their findings by kind, in the dataset's order; scenes without findings are left out.
    pub scenes: Vec<FoundInScene>,
}

/// The findings of one severity and code.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FoundCode {
    /// The severity.
    pub severity: Severity,
    /// The code, as in a finding.
    pub code: String,
    /// Number of findings.
    pub findings: usize,
    /// Number of scenes that have one.
    pub scenes: usize,
    /// The first scene that has one.
    pub first_scene: SceneId,
    /// The first finding of that scene.
    pub first: Finding,
}

/// The findings of one scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FoundInScene {
    /// The scene.
    pub scene: SceneId,
    /// Number of findings by severity and code.
    pub findings: Vec<FindingCount>,
}

/// Sums up the findings of the dataset's scenes.
pub fn findings(dataset: &Dataset, tool: &str) -> FindingsFile {
    let with_any = |scene: &&SceneFile| !scene.findings.is_empty();
    let in_scene =
        |scene: &SceneFile| FoundInScene { scene: scene.id.clone(), findings: FindingCount::of(scene.findings.iter()) };
    FindingsFile {
        format: FINDINGS_FORMAT.to_owned(),
        tool: tool.to_owned(),
        dataset: dataset.file.named(),
        codes: by_code(dataset.scenes.iter().map(|scene| (&scene.id, scene.findings.as_slice()))),
        scenes: dataset.scenes.iter().filter(with_any).map(in_scene).collect(),
    }
}

/// The kinds of findings, by severity, then the most frequent first.
pub fn by_code<'a>(scenes: impl Iterator<Item = (&'a SceneId, &'a [Finding])>) -> Vec<FoundCode> {
    let mut found: BTreeMap<(Severity, &str), FoundCode> = BTreeMap::new();
    for (scene, findings) in scenes {
        for FindingCount { severity, code, count } in FindingCount::of(findings.iter()) {
            let is_of = |finding: &&Finding| finding.severity == severity && finding.code == code;
            let Some(first) = findings.iter().find(is_of) else { continue };
            let row = found.entry((severity, first.code.as_str())).or_insert_with(|| FoundCode {
                severity,
                code,
                findings: 0,
                scenes: 0,
                first_scene: scene.clone(),
                first: first.clone(),
            });
            row.findings += count;
            row.scenes += 1;
        }
    }
    let mut found: Vec<FoundCode> = found.into_values().collect();
    found.sort_by(|a, b| a.severity.cmp(&b.severity).then(b.findings.cmp(&a.findings)));
    found
}

impl std::fmt::Display for FoundCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { severity, code, findings, scenes, first_scene, first } = self;
        let others = if *scenes > 1 { format!(" in {scenes} scenes") } else { String::new() };
        write!(
            f,
            "{severity} [{code}], {}{others}; first in {first_scene}: '{}'",
            counted(*findings, "finding"),
            first.file
        )?;
        if !first.place.is_empty() {
            write!(f, " {}", first.place)?;
        }
        write!(f, ": {}; {}", first.message, first.action)
    }
}

/// Longest code and place in a table, in characters.
const LONGEST_CELL: usize = 32;

/// The kinds as a table with an example each, then the scenes, for a terminal of `columns`; of any width if absent.
pub fn text(file: &FindingsFile, columns: Option<usize>) -> String {
    let mut rows = vec![row(["severity", "code", "first in", "findings", "scenes"])];
    rows.extend(file.codes.iter().map(|found| {
        let [severity, findings, scenes] =
            [found.severity.to_string(), found.findings.to_string(), found.scenes.to_string()];
        row([&severity, &shown(&found.code, LONGEST_CELL), found.first_scene.as_str(), &findings, &scenes])
    }));
    let codes = Table { title: "Findings about the sources, by code".to_owned(), words: 3, rows };
    let mut rows = vec![row(["scene", "most frequent", "errors", "warnings", "notes"])];
    rows.extend(file.scenes.iter().map(|scene| {
        let of = |severity: Severity| {
            let counts = scene.findings.iter().filter(|found| found.severity == severity);
            counts.map(|found| found.count).sum::<usize>().to_string()
        };
        // Of the gravest severity that the scene has.
        let gravest = scene.findings.iter().map(|found| found.severity).min();
        let most = scene.findings.iter().filter(|found| Some(found.severity) == gravest);
        let most = most.max_by(|a, b| a.count.cmp(&b.count).then(b.code.cmp(&a.code)));
        let most = most.map_or_else(String::new, |found| shown(&found.code, LONGEST_CELL));
        let [errors, warnings, notes] = [Severity::Error, Severity::Warning, Severity::Note].map(of);
        row([scene.scene.as_str(), &most, &errors, &warnings, &notes])
    }));
    let scenes = Table { title: "Findings by scene; scene.json lists them".to_owned(), words: 2, rows };
    [codes, scenes].map(|table| table.text(columns)).join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(severity: Severity, code: &str, place: usize) -> Finding {
        Finding::new(severity, code, "house.json", format!("/furniture/{place}"), "found", "done")
    }

    /// 184 scenes with 20 to 23 findings each are three lines, the gravest and then the most frequent first.
    #[test]
    fn kinds_are_counted_over_scenes() {
        let scenes: Vec<(SceneId, Vec<Finding>)> = (0..184)
            .map(|at| {
                let mut found: Vec<Finding> = (0..20).map(|k| finding(Severity::Note, "mirrored_piece", k)).collect();
                found.extend((0..at % 4).map(|k| finding(Severity::Warning, "missing_model", k)));
                found.extend((at == 100).then(|| finding(Severity::Warning, "bad_jid", 7)));
                (SceneId::new(format!("room-{at}")).unwrap(), found)
            })
            .collect();
        let found = by_code(scenes.iter().map(|(id, found)| (id, found.as_slice())));
        let lines: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert_eq!(
            lines,
            [
                "warning [missing_model], 276 findings in 138 scenes; first in room-1: 'house.json' /furniture/0: found; done",
                "warning [bad_jid], 1 finding; first in room-100: 'house.json' /furniture/7: found; done",
                "note [mirrored_piece], 3680 findings in 184 scenes; first in room-0: 'house.json' /furniture/0: found; done",
            ]
        );
        assert_eq!(by_code(std::iter::empty()), []);
    }
}
