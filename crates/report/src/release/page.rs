//! The page, `index.html`: one file with its style and script, beside which only pictures lie.
//!
//! Its first lines are numbers at a glance, what fails, and what was not given.

use mateval_dataset::{Finding, Severity};
use mateval_eval::protocol::Protocol;
use mateval_pages as pages;
use mateval_prep::stats::{Spread, StatsFile};
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::file::{Evaluated, ReleaseFile};
use super::given::ReferenceScores;
use super::page_scene::{ScenePage, cpu_seconds, duration, plural, shown_scores, worst_psnr};

const TEMPLATE: &str = include_str!("page.j2");

/// Opens the details of a scene that a link leads to.
const OPEN: &str = r#"// Opens the folded details that a link leads to.
function openTarget() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!target || target.tagName !== "DETAILS") return;
  target.open = true;
  target.scrollIntoView();
}

addEventListener("hashchange", openTarget);
openTarget();
"#;

/// The ceiling or the floor, as the page states it.
#[derive(Serialize)]
struct Bound<'a> {
    name: &'static str,
    scores: &'a ReferenceScores,
}

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
    let script = format!("{}\n{OPEN}", pages::SORT);
    let columns = shown_scores(file).map(|(title, unit, _)| (title, unit));
    let values = context! {
        title => format!("{} {}", file.dataset.name, file.dataset.version),
        file => Serde(file), secrecy => file.withheld.as_ref().map(|withheld| withheld.secrecy.text()), scenes => Serde(&sorted), headlines => Serde(headlines(file)),
        failures => Serde(failures), whole => whole_findings(file), not_given => Serde(not_given(file)),
        table_one => Serde(rows(&file.stats, file.evaluated)), columns, bounds => Serde(bounds(file)),
        is_good => file.is_good(), is_captured => file.is_captured(),
    };
    pages::single(TEMPLATE, values, &script)
}

fn bounds(file: &ReleaseFile) -> Vec<Bound<'_>> {
    let both = [("ceiling", &file.ceiling), ("floor", &file.floor)];
    both.into_iter().filter_map(|(name, scores)| Some(Bound { name, scores: scores.as_ref()? })).collect()
}

#[derive(Serialize)]
struct Headline {
    value: String,
    label: String,
    is_bad: bool,
}

/// A scene that fails, and why.
#[derive(Serialize)]
struct Failure {
    scene: String,
    reasons: Vec<String>,
}

fn headlines(file: &ReleaseFile) -> Vec<Headline> {
    let mut all = vec![scenes(file), verified_headline(file), compared_headline(file), noise_headline(file)];
    all.extend(shown_scores(file).map(|(title, unit, key)| {
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
        plain(value, format!("floor to ceiling: {}, {unit}", title.to_lowercase()))
    }));
    all.push(cost_headline(file));
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

fn verified_headline(file: &ReleaseFile) -> Headline {
    let errors = file.verification.findings.iter().filter(|finding| finding.severity == Severity::Error).count();
    let value = if errors == 0 { "sound".to_owned() } else { format!("{errors} error{}", plural(errors)) };
    Headline { value, label: "prep verify".to_owned(), is_bad: errors > 0 }
}

/// The number of scenes that two renderers can be compared on.
fn comparable(file: &ReleaseFile) -> usize {
    file.scenes.iter().filter(|scene| !scene.photo).count()
}

fn compared_headline(file: &ReleaseFile) -> Headline {
    let (all, given) = (comparable(file), file.comparisons().count());
    let agree = file.comparisons().filter(|verdict| verdict.agrees).count();
    match given {
        0 => plain("not compared".to_owned(), "two renderers, prep compare".to_owned()),
        _ => {
            let open = file.comparisons().filter(|verdict| verdict.agrees && verdict.undecided() > 0).count();
            let open = if open > 0 { format!("; some checks of {open} are undecided") } else { String::new() };
            let rest = if given < all { format!("; {} of {all} not compared", all - given) } else { String::new() };
            let label = format!("compared scenes on which two renderers agree{open}{rest}");
            Headline { value: format!("{agree} of {given}"), label, is_bad: agree < given }
        }
    }
}

fn noise_headline(file: &ReleaseFile) -> Headline {
    let mut worst: Vec<f64> = file.scenes.iter().filter_map(worst_psnr).collect();
    worst.sort_by(f64::total_cmp);
    let value = match worst[..] {
        [] if file.withheld.is_some() => "withheld".to_owned(),
        [] => "not rendered".to_owned(),
        _ => format!("{:.1} dB", worst[worst.len() / 2]),
    };
    plain(value, "noise of the photo's renderer: PSNR of a scene's noisiest view, median of the scenes".to_owned())
}

fn cost_headline(file: &ReleaseFile) -> Headline {
    let known: Vec<f64> = file.scenes.iter().filter_map(|scene| cpu_seconds(&scene.costs)).collect();
    let all = file.scenes.len();
    match known.len() {
        0 => plain("not recorded".to_owned(), "cost: processor time".to_owned()),
        n if n == all => plain(duration(known.iter().sum()), "cost: processor time of all scenes".to_owned()),
        n => plain(duration(known.iter().sum()), format!("cost: processor time of {n} of {all} scenes")),
    }
}

/// The scenes that fail, in the dataset's order.
fn failures(scenes: &[ScenePage<'_>]) -> Vec<Failure> {
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
fn whole_findings(file: &ReleaseFile) -> Vec<String> {
    file.verified_whole().map(Finding::to_string).collect()
}

/// What the page does not state, and the commands that provide it.
#[derive(Serialize)]
pub(crate) struct Missing {
    what: String,
    commands: Vec<String>,
}

/// Everything that the page does not state because it was not given.
fn not_given(file: &ReleaseFile) -> Vec<Missing> {
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
    let protocol = if file.is_captured() { format!(" --protocol {}", Protocol::CAPTURE) } else { String::new() };
    // The truth of a captured room is not known, so that nothing could be its ceiling.
    if !file.is_captured() {
        missing.extend(without_bound("ceiling", "gt", file.ceiling.as_ref(), all, &protocol));
    }
    missing.extend(without_bound("floor", "grey", file.floor.as_ref(), all, &protocol));
    if no_cost > 0 {
        let what = format!("The cost of {no_cost} of {all} scenes was not recorded in the dataset's `.build`");
        missing.push(Missing { what, commands: Vec::new() });
    }
    missing
}

/// What is missing of a bound, which is the result of the baseline `method`. `protocol` are the words that choose one.
fn without_bound(
    name: &str,
    method: &str,
    scores: Option<&ReferenceScores>,
    all: usize,
    protocol: &str,
) -> Option<Missing> {
    let commands = || {
        vec![
            format!("mateval baseline {method} --dataset DATASET --out {method}"),
            format!("mateval eval score {method} --dataset DATASET{protocol} --out {method}.json"),
            format!("mateval prep publish DATASET --report DIR{protocol} --{name} {method}.json"),
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

/// A row of Table I: the three columns of the paper (MatEval, PSDR-Room, PhotoScene), and the release.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
struct Row {
    title: &'static str,
    paper: [&'static str; 3],
    ours: String,
}

const YES: &str = "✓";
const NO: &str = "✗";

/// The rows of Table I, the release's numbers rounded as the paper's.
fn rows(stats: &StatsFile, evaluated: Evaluated) -> Vec<Row> {
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use mateval_dataset::dataset::{DatasetVersion, Secrecy};
    use mateval_dataset::scene_cost::{Step, StepCost};
    use mateval_dataset::{SceneId, SourceKind, ViewId};
    use mateval_eval::result::key::ResultKey;
    use mateval_prep::compare::file::State;
    use mateval_prep::stats::{Counts, STATS_FORMAT, SceneStats};

    use super::super::file::{
        NOT_SHOWN, Publication, RELEASE_FORMAT, ReleasedDataset, ReleasedScene, Verification, withhold,
    };
    use super::super::given::{SceneVerdict, StateCount};
    use super::super::remake::{Remake, SceneInputs};
    use super::super::renders::ViewNoise;

    use super::*;

    const SCENES: usize = 184;

    /// Scene 170 does not agree, scene 180 has an error.
    fn release() -> ReleaseFile {
        let scenes: Vec<ReleasedScene> = (0..SCENES).map(scene).collect();
        let ids = || scenes.iter().map(|scene| scene.scene.clone());
        let spread = |mean| Some(Spread { scenes: SCENES, mean, min: 1, max: 20 });
        ReleaseFile {
            format: RELEASE_FORMAT.to_owned(),
            tool: "mateval 0".to_owned(),
            dataset: ReleasedDataset {
                name: "made-up".to_owned(),
                version: "1.0".to_owned(),
                manifest_sha256: "0123456789abcdef".repeat(4),
                photo_renderer: None,
            },
            publication: Publication::default(),
            citation: "@misc{made-up}".to_owned(),
            withheld: None,
            stats: StatsFile {
                format: STATS_FORMAT.to_owned(),
                tool: "mateval 0".to_owned(),
                dataset: DatasetVersion {
                    name: "made-up".to_owned(),
                    version: "1.0".to_owned(),
                    manifest_sha256: String::new(),
                },
                scenes: SCENES,
                houses: 120,
                source_kinds: Vec::new(),
                objects_per_scene: spread(13.17),
                super_categories_per_scene: spread(4.3),
                categories_per_scene: spread(8.0),
                look: None,
                beside: None,
                total: counts(),
                per_scene: ids()
                    .map(|scene| SceneStats {
                        scene,
                        source_kind: SourceKind::Front3d,
                        house: "a house".to_owned(),
                        counts: counts(),
                    })
                    .collect(),
            },
            evaluated: Evaluated { original_view: true, novel_view: true, albedo: true },
            verification: Verification { sound: false, findings: vec![finding(180, "scene 180 is broken")] },
            ceiling: Some(scores("gt", 49.0, ids())),
            floor: Some(scores("grey", 9.5, ids())),
            rendered: Vec::new(),
            remake: Some(Remake {
                tool: "mateval 0".to_owned(),
                recipe_sha256: String::new(),
                recipe: "name = \"made-up\"".to_owned(),
                commands: vec!["mateval prep build recipe.toml --source SOURCE --out DATASET".to_owned()],
            }),
            licences: Vec::new(),
            without_licence: ids().collect(),
            scenes,
        }
    }

    fn id(at: usize) -> SceneId {
        SceneId::new(format!("0a1b2c3d-livingdiningroom-{at:03}")).unwrap()
    }

    fn finding(at: usize, message: &str) -> Finding {
        Finding::new(
            Severity::Error,
            "bad",
            format!("scenes/{}/views/input/depth.exr", id(at)),
            "pixel 1.2345678",
            message,
            "make it again",
        )
    }

    fn counts() -> Counts {
        Counts {
            instances: 20,
            objects: 13,
            architecture: 7,
            others: 0,
            instances_with_atlas: 20,
            unstated: Default::default(),
            super_categories: Vec::new(),
            categories: Vec::new(),
            findings: Vec::new(),
        }
    }

    fn scene(at: usize) -> ReleasedScene {
        let agrees = at != 170;
        let count = |state, checks| StateCount { state, checks };
        let cost = |step, seconds| StepCost {
            step,
            renderer: None,
            runs: 1,
            wall_seconds: seconds,
            cpu_seconds: Some(2.0 * seconds),
        };
        let view = |view: &&str| ViewNoise {
            view: ViewId::new(*view).unwrap(),
            mean_of_halves_mse: 1.23456789e-4,
            denoised_mse: 1e-5,
            mean_of_halves_psnr_db: Some(36.0 + at as f64 / 50.0),
        };
        let note = |_: usize| Finding {
            severity: Severity::Note,
            place: "/parts/3".to_owned(),
            ..finding(at, "a part has no area and was left out")
        };
        ReleasedScene {
            scene: id(at),
            photo: false,
            picture: None,
            comparison: (at % 10 != 3).then(|| SceneVerdict {
                tool: "mateval 0".to_owned(),
                agrees,
                checks: if agrees {
                    vec![count(State::Agrees, 75)]
                } else {
                    vec![count(State::Agrees, 74), count(State::Differs, 1)]
                },
                faults: Some(if agrees { Vec::new() } else { vec!["input: rgb DIFFERS: 12.3 %".to_owned()] }),
            }),
            noise: Some(["input", "up_left", "up_right", "down_left", "down_right"].iter().map(view).collect()),
            costs: vec![cost(Step::Build, 40.0), cost(Step::Render, 1800.0), cost(Step::Scorer, 300.0)],
            findings: (0..at % 7).map(note).collect(),
            inputs: Some(SceneInputs { files: 40, sha256: "0123456789abcdef".repeat(4) }),
        }
    }

    fn scores(method: &str, psnr: f64, ids: impl Iterator<Item = SceneId>) -> ReferenceScores {
        let keys = ["albedo.novel.psnr", "rgb_true.novel.psnr", "albedo.input.psnr"];
        let values = |add: f64| -> BTreeMap<ResultKey, f64> {
            keys.iter().enumerate().map(|(at, key)| (key.parse().unwrap(), psnr + add + at as f64)).collect()
        };
        ReferenceScores {
            tool: "mateval 0".to_owned(),
            method: method.to_owned(),
            description: String::new(),
            protocol: "mateval-3".to_owned(),
            scorer_version: 1,
            fingerprint: "f".repeat(64),
            scenes_scored: SCENES,
            summary: values(0.25),
            summary_noise: BTreeMap::new(),
            scenes: Some(ids.enumerate().map(|(at, id)| (id, values(at as f64 / 1e3))).collect()),
            noise: Some(BTreeMap::new()),
        }
    }

    #[test]
    fn many_scenes_stay_readable_and_failures_come_first() {
        let html = page(&release());
        if let Some(folder) = std::env::var_os("MATEVAL_TEST_PICTURES") {
            std::fs::write(std::path::Path::new(&folder).join("release.html"), &html).unwrap();
        }
        assert!(html.len() < 1_500_000, "{} bytes", html.len());
        let table = &html[html.find("<h2 id=\"scenes\">").unwrap()..html.find("<h2 id=\"details\">").unwrap()];
        let rows: Vec<&str> = table.split("<tr><th scope=\"row\"").skip(1).collect();
        assert_eq!(rows.len(), SCENES);
        for (row, at) in rows.iter().zip([170, 180, 0, 1]) {
            assert!(row.contains(id(at).as_str()), "{row}");
        }
        assert!(rows[1].contains("1 error") && rows[0].contains("74 of 75 agree"), "{}", rows[0]);
        let summary = &html[..html.find("<h2 id=\"scenes\">").unwrap()];
        for text in [
            "What fails",
            "2 scenes",
            "74 of 75 checks agree, 1 differs",
            "19 of 184 scenes are not compared",
            "13.2",
            "9.75 – 49.25",
            "218.8 h",
        ] {
            assert!(summary.contains(text), "no '{text}' in {summary}");
        }
    }

    /// Nothing is asked for that a captured room does not have. The twin is one rendered room among them.
    #[test]
    fn captured_rooms_have_scores_of_their_own() {
        let mut file = ReleaseFile { ceiling: None, floor: None, ..release() };
        file.stats.per_scene.iter_mut().for_each(|scene| scene.source_kind = SourceKind::Capture);
        let html = page(&file);
        for text in
            ["measured on regions", "measured colours, CIEDE2000", "DATASET --protocol capture-1 --out grey.json"]
        {
            assert!(html.contains(text), "no '{text}'");
        }
        assert!(!html.contains("baseline gt") && !html.contains("albedo, novel views"));
        file.stats.per_scene[0].source_kind = SourceKind::Front3d;
        let html = page(&file);
        assert!(html.contains("baseline gt") && html.contains("albedo, novel views, PSNR in dB"));
        assert!(!html.contains("capture-1"));
    }

    #[test]
    fn a_withheld_truth_leaves_verdicts_and_means() {
        let mut file = release();
        withhold(&mut file, Secrecy::Secret, "c0ffee");
        let html = page(&file);
        for text in ["scene 180 is broken", "1.2345678", "12.3 %", "36.0", "9.51 –"] {
            assert!(!html.contains(text), "'{text}' leaks");
            assert!(page(&release()).contains(text), "no '{text}' without withholding");
        }
        for text in ["c0ffee", NOT_SHOWN, "1 error", "74 of 75 checks agree", "9.75 – 49.25"] {
            assert!(html.contains(text), "no '{text}'");
        }
        // The mean over one scene is a score.
        file.ceiling.as_mut().unwrap().scenes_scored = 1;
        withhold(&mut file, Secrecy::Secret, "c0ffee");
        assert!(file.ceiling.unwrap().summary.is_empty() && !file.floor.unwrap().summary.is_empty());
    }

    /// The mean over one scene is that scene's score: of a value that one scene alone has, too.
    #[test]
    fn a_withheld_truth_leaves_no_mean_over_one_scene() {
        let mut file = release();
        let ceiling = file.ceiling.as_mut().unwrap();
        let of_one = *ceiling.summary.keys().next().unwrap();
        assert!(ceiling.summary.len() > 1);
        let scenes = ceiling.scenes.as_mut().unwrap();
        let first = scenes.keys().next().unwrap().clone();
        scenes
            .iter_mut()
            .filter(|(id, _)| **id != first)
            .for_each(|(_, values)| values.retain(|key, _| *key != of_one));
        let mut alone = release();
        alone.ceiling.as_mut().unwrap().scenes.as_mut().unwrap().retain(|id, _| *id == first);
        for file in [&mut file, &mut alone] {
            withhold(file, Secrecy::Secret, "c0ffee");
            assert!(!file.floor.as_ref().unwrap().summary.is_empty());
        }
        let left = file.ceiling.unwrap().summary;
        assert!(!left.is_empty() && !left.contains_key(&of_one), "{left:?}");
        assert!(alone.ceiling.unwrap().summary.is_empty());
    }
}
