//! The first lines of the page: numbers at a glance, what fails, and what was not given.

use mateval_scene::{Finding, Severity};
use serde::Serialize;

use crate::file::ReleaseFile;
use crate::page_scene::{SHOWN_SCORES, ScenePage, cpu_seconds, duration, plural, worst_psnr};
use crate::reference_scores::ReferenceScores;

/// A number at a glance.
#[derive(Serialize)]
pub(crate) struct Headline {
    value: String,
    label: String,
    is_bad: bool,
}

/// A scene that fails, and why.
#[derive(Serialize)]
pub(crate) struct Failure {
    scene: String,
    reasons: Vec<String>,
}

/// The numbers at a glance.
pub(crate) fn headlines(file: &ReleaseFile) -> Vec<Headline> {
    let mut all = vec![scenes(file), verified(file), compared(file), noise(file)];
    all.extend(SHOWN_SCORES.map(|(title, key)| {
        let mean = |scores: &Option<ReferenceScores>| {
            let value = scores.as_ref().and_then(|scores| scores.summary.get(&key));
            value.map(|value| key.metric.style().text(*value))
        };
        let value = match (mean(&file.floor), mean(&file.ceiling)) {
            (None, None) if file.withheld.is_some() && (file.floor.is_some() || file.ceiling.is_some()) => {
                "withheld".to_owned()
            }
            (None, None) => "not given".to_owned(),
            (floor, ceiling) => {
                let text = |side: Option<String>| side.unwrap_or_else(|| "?".to_owned());
                format!("{} – {}", text(floor), text(ceiling))
            }
        };
        plain(value, format!("floor to ceiling: {}, PSNR in dB", title.to_lowercase()))
    }));
    all.push(cost(file));
    all
}

fn plain(value: String, label: String) -> Headline {
    Headline { value, label, is_bad: false }
}

fn scenes(file: &ReleaseFile) -> Headline {
    let houses = file.stats.houses;
    let label = format!("scene{} of {houses} house{}", plural(file.stats.scenes), plural(houses));
    plain(file.stats.scenes.to_string(), label)
}

fn verified(file: &ReleaseFile) -> Headline {
    let errors = file.verification.findings.iter().filter(|finding| finding.severity == Severity::Error).count();
    let value = if errors == 0 { "sound".to_owned() } else { format!("{errors} error{}", plural(errors)) };
    Headline { value, label: "prep verify".to_owned(), is_bad: errors > 0 }
}

/// The number of scenes that two renderers can be compared on.
fn comparable(file: &ReleaseFile) -> usize {
    file.scenes.iter().filter(|scene| !scene.photo).count()
}

fn compared(file: &ReleaseFile) -> Headline {
    let (all, given) = (comparable(file), file.comparisons().count());
    let agree = file.comparisons().filter(|verdict| verdict.agrees).count();
    match given {
        0 => plain("not compared".to_owned(), "two renderers, prep compare".to_owned()),
        _ => {
            let rest = if given < all { format!("; {} of {all} not compared", all - given) } else { String::new() };
            let label = format!("compared scenes on which two renderers agree{rest}");
            Headline { value: format!("{agree} of {given}"), label, is_bad: agree < given }
        }
    }
}

fn noise(file: &ReleaseFile) -> Headline {
    let mut worst: Vec<f64> = file.scenes.iter().filter_map(worst_psnr).collect();
    worst.sort_by(f64::total_cmp);
    let value = match worst[..] {
        [] if file.withheld.is_some() => "withheld".to_owned(),
        [] => "not rendered".to_owned(),
        _ => format!("{:.1} dB", worst[worst.len() / 2]),
    };
    plain(value, "noise of the photo's renderer: PSNR of a scene's noisiest view, median of the scenes".to_owned())
}

fn cost(file: &ReleaseFile) -> Headline {
    let known: Vec<f64> = file.scenes.iter().filter_map(|scene| cpu_seconds(&scene.costs)).collect();
    let all = file.scenes.len();
    match known.len() {
        0 => plain("not recorded".to_owned(), "cost: processor time".to_owned()),
        n if n == all => plain(duration(known.iter().sum()), "cost: processor time of all scenes".to_owned()),
        n => plain(duration(known.iter().sum()), format!("cost: processor time of {n} of {all} scenes")),
    }
}

/// The scenes that fail, in the dataset's order.
pub(crate) fn failures(scenes: &[ScenePage<'_>]) -> Vec<Failure> {
    let failure = |page: &ScenePage<'_>| {
        let verdicts =
            [("prep verify", &page.verified, &page.verified.text), ("prep compare", &page.compared, &page.checks)];
        let failing = verdicts.into_iter().filter(|(_, verdict, _)| verdict.state == "bad");
        Failure {
            scene: page.scene.scene.to_string(),
            reasons: failing.map(|(command, _, text)| format!("{command}: {text}")).collect(),
        }
    };
    scenes.iter().filter(|page| page.fails()).map(failure).collect()
}

/// The findings of `prep verify` that are about no single scene.
pub(crate) fn whole_findings(file: &ReleaseFile) -> Vec<String> {
    file.verified_whole().map(Finding::to_string).collect()
}

/// What the page does not state, and the commands that provide it.
#[derive(Serialize)]
pub(crate) struct Missing {
    what: String,
    commands: Vec<String>,
}

/// Everything that the page does not state because it was not given.
pub(crate) fn not_given(file: &ReleaseFile) -> Vec<Missing> {
    let all = file.scenes.len();
    let not_compared = comparable(file).saturating_sub(file.comparisons().count());
    let no_cost = file.scenes.iter().filter(|scene| scene.costs.is_empty()).count();
    let mut missing = Vec::new();
    if not_compared > 0 {
        missing.push(Missing {
            what: format!("{not_compared} of {} scenes are not compared", comparable(file)),
            commands: vec![
                "mateval prep compare DATASET --scene ID --out compare/ID".to_owned(),
                "mateval prep publish DATASET --report DIR --verdicts compare".to_owned(),
            ],
        });
    }
    missing.extend(without_bound("ceiling", "gt", file.ceiling.as_ref(), all));
    missing.extend(without_bound("floor", "grey", file.floor.as_ref(), all));
    if no_cost > 0 {
        let what = format!("The cost of {no_cost} of {all} scenes was not recorded in the dataset's `.build`");
        missing.push(Missing { what, commands: Vec::new() });
    }
    missing
}

/// What is missing of a bound, which is the result of the baseline `method`.
fn without_bound(name: &str, method: &str, scores: Option<&ReferenceScores>, all: usize) -> Option<Missing> {
    let commands = || {
        vec![
            format!("mateval baseline {method} --dataset DATASET --out {method}"),
            format!("mateval eval score {method} --dataset DATASET --out {method}.json"),
            format!("mateval prep publish DATASET --report DIR --{name} {method}.json"),
        ]
    };
    match scores {
        None => Some(Missing { what: format!("The {name} is not given"), commands: commands() }),
        Some(scores) if scores.scenes_scored < all => {
            let what = format!("The {name} was scored on {} of {all} scenes", scores.scenes_scored);
            Some(Missing { what, commands: Vec::new() })
        }
        Some(_) => None,
    }
}
