//! The page, `index.html`: one file with its style and script, beside which only pictures lie.

use mateval_report::page_style::{SORT, STYLE};
use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, context};
use serde::Serialize;
use sha2::{Digest as _, Sha256};

use crate::file::ReleaseFile;
use crate::page_scene::{SHOWN_SCORES, ScenePage};
use crate::page_summary::{failures, headlines, not_given, whole_findings};
use crate::reference_scores::ReferenceScores;
use crate::table_one;

const TEMPLATE: &str = include_str!("page.j2");

/// Opens the details of a scene that a link leads to.
const OPEN: &str = include_str!("open.js");

/// The ceiling or the floor, as the page states it.
#[derive(Serialize)]
struct Bound<'a> {
    name: &'static str,
    scores: &'a ReferenceScores,
}

/// The page.
pub(crate) fn page(file: &ReleaseFile) -> String {
    let scenes: Vec<ScenePage<'_>> = file
        .scenes
        .iter()
        .zip(&file.stats.per_scene)
        .map(|(scene, stats)| ScenePage::new(file, scene, stats))
        .collect();
    let failures = failures(&scenes);
    let mut sorted: Vec<&ScenePage<'_>> = scenes.iter().collect();
    // The sort is stable: the dataset's order remains within the failures and the others.
    sorted.sort_by_key(|page| !page.fails());
    let script = format!("{SORT}\n{OPEN}");
    let columns = SHOWN_SCORES.map(|(title, _)| title);
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    let text = environment.render_str(
        TEMPLATE,
        context! {
            style => STYLE, style_hash => csp_hash(STYLE), script => &script, script_hash => csp_hash(&script),
            file => Serde(file), scenes => Serde(&sorted), headlines => Serde(headlines(file)),
            failures => Serde(failures), whole => whole_findings(file), not_given => Serde(not_given(file)),
            table_one => Serde(table_one::rows(&file.stats, file.evaluated)), columns, bounds => Serde(bounds(file)),
            is_good => file.is_good(),
        },
    );
    text.expect("a test fills the template")
}

fn bounds(file: &ReleaseFile) -> Vec<Bound<'_>> {
    let both = [("ceiling", &file.ceiling), ("floor", &file.floor)];
    both.into_iter().filter_map(|(name, scores)| Some(Bound { name, scores: scores.as_ref()? })).collect()
}

/// The hash by which the page's policy allows the text of an element.
fn csp_hash(text: &str) -> String {
    format!("'sha256-{}'", base64::encode(Sha256::digest(text.as_bytes())))
}
