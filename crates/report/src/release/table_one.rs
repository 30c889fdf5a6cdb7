//! The paper's Table I with a column for the release.

use std::collections::BTreeSet;

use mateval_dataset::dataset::Target;
use mateval_dataset::layout::INPUT;
use mateval_dataset::manifest::Manifest;
use mateval_dataset::open::Dataset;
use mateval_prep::stats::{Spread, StatsFile};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReportError;

/// What the release scores: the last three rows of Table I.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Evaluated {
    /// Whether input views are scored.
    pub original_view: bool,
    /// Whether other views are scored.
    pub novel_view: bool,
    /// Whether every scored view has its true albedo.
    pub albedo: bool,
}

impl Evaluated {
    pub(crate) fn of(dataset: &Dataset) -> Result<Self, ReportError> {
        let targets = &dataset.targets.targets;
        let is_input = |target: &&Target| target.view.as_str() == INPUT;
        let Manifest { entries, withheld, .. } = Manifest::read(&dataset.root)?;
        let files: BTreeSet<String> = entries.into_iter().map(|entry| entry.file).chain(withheld).collect();
        let albedo = |target: &Target| {
            files.contains(&format!("scenes/{}/ground_truth/views/{}/albedo.exr", target.scene, target.view))
        };
        Ok(Self {
            original_view: targets.iter().any(|target| is_input(&target)),
            novel_view: !targets.iter().all(|target| is_input(&target)),
            albedo: !targets.is_empty() && targets.iter().all(albedo),
        })
    }
}

/// A row: the three columns of the paper (MatEval, PSDR-Room, PhotoScene), and the release.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Row {
    pub(crate) title: &'static str,
    pub(crate) paper: [&'static str; 3],
    pub(crate) ours: String,
}

const YES: &str = "✓";
const NO: &str = "✗";

/// All rows, the release's numbers rounded as the paper's.
pub(crate) fn rows(stats: &StatsFile, evaluated: Evaluated) -> Vec<Row> {
    let row = |title, paper, ours| Row { title, paper, ours };
    let mean =
        |spread: Option<Spread>| spread.map_or_else(|| "unknown".to_owned(), |spread| format!("{:.1}", spread.mean));
    let mark = |is_scored: bool| if is_scored { YES } else { NO }.to_owned();
    vec![
        row("Number of scenes", ["184", "7", "70"], stats.scenes.to_string()),
        row("Avg. objects / scene", ["13.2", "not stated", "9.4"], mean(stats.objects_per_scene)),
        row("Avg. categories / scene", ["4.3", "not stated", "4.1"], mean(stats.super_categories_per_scene)),
        row("Original view eval.", [YES, YES, YES], mark(evaluated.original_view)),
        row("Novel view eval.", [YES, NO, NO], mark(evaluated.novel_view)),
        row("Albedo eval.", [YES, NO, NO], mark(evaluated.albedo)),
    ]
}
