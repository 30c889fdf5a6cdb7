//! What the page shows of one scene: a row of the table, and the folded details. Numbers are rounded here.

use mateval_dataset::scene_cost::{Step, StepCost};
use mateval_dataset::{Finding, Severity};
use mateval_eval::metric::{Metric, PictureKind};
use mateval_eval::result::key::{ResultKey, Surfaces, Views};
use mateval_prep::compare::file::State;
use mateval_prep::stats::SceneStats;
use serde::Serialize;

use super::file::{ReleaseFile, ReleasedScene};
use super::given::{ReferenceScores, SceneVerdict, StateCount};

/// A score that the page shows: its title, its unit and its key.
pub(crate) type ShownScore = (&'static str, &'static str, ResultKey);

const PSNR_IN_DB: &str = "PSNR in dB";

const OF_RENDERED: [ShownScore; 2] = [
    ("Albedo, novel views", PSNR_IN_DB, ResultKey::whole(PictureKind::Albedo, Views::Novel, Metric::Psnr)),
    ("Light, novel views", PSNR_IN_DB, ResultKey::whole(PictureKind::RgbTrue, Views::Novel, Metric::Psnr)),
];

const OF_CAPTURED: [ShownScore; 2] = [
    ("Measured colours", "CIEDE2000", ResultKey::whole(PictureKind::Measured, Views::Input, Metric::RegionDeltaE)),
    ("Other photos", PSNR_IN_DB, ResultKey::whole(PictureKind::RgbFitted, Views::Novel, Metric::Psnr)),
];

/// The scores of the table's columns.
pub(crate) fn shown_scores(file: &ReleaseFile) -> [ShownScore; 2] {
    if file.is_captured() { OF_CAPTURED } else { OF_RENDERED }
}

/// A cell: what the column is sorted by, and its text.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Cell {
    pub(crate) value: Option<f64>,
    pub(crate) text: String,
}

/// A verdict in words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Verdict {
    /// `good`, `bad` or `none`.
    pub(crate) state: &'static str,
    pub(crate) text: String,
    /// Failures sort first.
    pub(crate) order: usize,
}

/// Everything that the page shows of a scene.
#[derive(Serialize)]
pub(crate) struct ScenePage<'a> {
    pub(crate) scene: &'a ReleasedScene,
    source: String,
    house: &'a str,
    pub(crate) verified: Verdict,
    pub(crate) compared: Verdict,
    objects: Cell,
    categories: Cell,
    noise: Cell,
    cost: Cell,
    scores: Vec<Cell>,
    findings: Cell,
    verify_findings: Vec<String>,
    source_findings: Vec<String>,
    faults: &'a [String],
    /// The counts of a comparison's checks; empty where it was not compared.
    pub(crate) checks: String,
    compare_tool: Option<&'a str>,
    views: Vec<[String; 3]>,
    steps: Vec<[String; 4]>,
    all_scores: Vec<[String; 3]>,
    ceiling_errors: Vec<String>,
}

impl<'a> ScenePage<'a> {
    pub(crate) fn new(file: &'a ReleaseFile, scene: &'a ReleasedScene, stats: &'a SceneStats) -> Self {
        let comparison = scene.comparison.as_ref();
        let known = |number: usize| match stats.knows_its_objects() {
            true => Cell { value: Some(number as f64), text: number.to_string() },
            false => Cell { value: None, text: "unknown".to_owned() },
        };
        Self {
            scene,
            source: stats.source_kind.to_string(),
            house: &stats.house,
            verified: verified(file, scene),
            compared: compared(comparison),
            objects: known(stats.counts.objects),
            categories: known(stats.counts.different_super_categories()),
            noise: noise(file, scene),
            cost: cost(&scene.costs),
            scores: shown_scores(file).map(|(_, _, key)| between(file, scene, key)).into(),
            findings: findings(scene),
            verify_findings: file.verified(&scene.scene).map(Finding::to_string).collect(),
            source_findings: scene.findings.iter().map(Finding::to_string).collect(),
            faults: comparison.and_then(|verdict| verdict.faults.as_deref()).unwrap_or_default(),
            checks: comparison.map(checks).unwrap_or_default(),
            compare_tool: comparison.map(|verdict| verdict.tool.as_str()),
            views: views(scene),
            steps: scene.costs.iter().map(step).collect(),
            all_scores: all_scores(file, scene),
            ceiling_errors: ceiling_errors(file, scene),
        }
    }

    /// Whether a verdict speaks against the scene.
    pub(crate) fn fails(&self) -> bool {
        self.verified.state == "bad" || self.compared.state == "bad"
    }
}

fn verified(file: &ReleaseFile, scene: &ReleasedScene) -> Verdict {
    let errors = file.verified(&scene.scene).filter(|finding| finding.severity == Severity::Error).count();
    match errors {
        0 => Verdict { state: "good", text: "sound".to_owned(), order: 1 },
        _ => Verdict { state: "bad", text: format!("{errors} error{}", plural(errors)), order: 0 },
    }
}

/// The end of a word that counts.
pub(crate) fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

fn compared(verdict: Option<&SceneVerdict>) -> Verdict {
    match verdict {
        None => Verdict { state: "none", text: "not compared".to_owned(), order: 1 },
        Some(verdict) if verdict.agrees && verdict.undecided() == 0 => {
            Verdict { state: "good", text: "agree".to_owned(), order: 3 }
        }
        Some(verdict) if verdict.agrees => {
            Verdict { state: "none", text: format!("agree, {} undecided", verdict.undecided()), order: 2 }
        }
        Some(verdict) => {
            Verdict { state: "bad", text: format!("{} of {} agree", agreeing(verdict), verdict.total()), order: 0 }
        }
    }
}

/// The number of checks that agree.
fn agreeing(verdict: &SceneVerdict) -> usize {
    verdict.checks.iter().filter(|count| count.state == State::Agrees).map(|count| count.checks).sum()
}

/// As in `72 of 75 checks agree, 3 differ`.
fn checks(verdict: &SceneVerdict) -> String {
    let others = verdict.checks.iter().filter(|count| count.state != State::Agrees);
    let others: String = others.map(|count| format!(", {} {}", count.checks, words(count))).collect();
    format!("{} of {} checks agree{others}", agreeing(verdict), verdict.total())
}

fn words(count: &StateCount) -> &'static str {
    match count.state {
        State::Agrees => "agree",
        State::Differs if count.checks == 1 => "differs",
        State::Differs => "differ",
        State::TooNoisy => "too noisy",
        State::TooFew => "of too few samples",
        State::Undecided => "undecided",
        State::Missing => "missing",
        State::Unreadable => "unreadable",
    }
}

/// The noisiest view.
fn noise(file: &ReleaseFile, scene: &ReleasedScene) -> Cell {
    let absent = |text: &str| Cell { value: None, text: text.to_owned() };
    match worst_psnr(scene) {
        Some(worst) => Cell { value: Some(worst), text: format!("{worst:.1} dB") },
        None if file.withheld.is_some() => absent("withheld"),
        None if scene.noise.as_ref().is_some_and(|views| !views.is_empty()) => absent("none"),
        None => absent("not rendered"),
    }
}

/// The PSNR of the noisiest view, in dB; absent if no view has noise that is known.
pub(crate) fn worst_psnr(scene: &ReleasedScene) -> Option<f64> {
    let views = scene.noise.iter().flatten();
    views.filter_map(|view| view.mean_of_halves_psnr_db).min_by(f64::total_cmp)
}

/// The processor time of all steps; elapsed time where a step has no processor time.
fn cost(costs: &[StepCost]) -> Cell {
    if costs.is_empty() {
        return Cell { value: None, text: "not recorded".to_owned() };
    }
    match cpu_seconds(costs) {
        Some(seconds) => Cell { value: Some(seconds), text: duration(seconds) },
        None => {
            let wall: f64 = costs.iter().map(|cost| cost.wall_seconds).sum();
            Cell { value: Some(wall), text: format!("{} elapsed", duration(wall)) }
        }
    }
}

/// The processor time of all steps, in seconds; absent if that of a step is unknown, or no step was recorded.
pub(crate) fn cpu_seconds(costs: &[StepCost]) -> Option<f64> {
    let seconds: Vec<f64> = costs.iter().map(|cost| cost.cpu_seconds).collect::<Option<_>>()?;
    (!seconds.is_empty()).then(|| seconds.iter().sum())
}

/// As in `12.3 s`, `4.5 min` or `6.7 h`.
pub(crate) fn duration(seconds: f64) -> String {
    match seconds {
        ..100.0 => format!("{seconds:.1} s"),
        ..6000.0 => format!("{:.1} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}

/// Floor and ceiling of a score, as in `9.65 – 49.69`.
fn between(file: &ReleaseFile, scene: &ReleasedScene, key: ResultKey) -> Cell {
    let [floor, ceiling] = [&file.floor, &file.ceiling].map(|scores| score(scores.as_ref(), scene, key));
    let [floor_text, ceiling_text] =
        [(&file.floor, floor), (&file.ceiling, ceiling)].map(|(scores, value)| match value {
            Some(value) => key.metric.style().text(value),
            None if scores.is_none() => "not given".to_owned(),
            None if file.withheld.is_some() => "withheld".to_owned(),
            None => "not scored".to_owned(),
        });
    let is_same = floor.is_none() && ceiling.is_none() && floor_text == ceiling_text;
    let text = if is_same { floor_text } else { format!("{floor_text} – {ceiling_text}") };
    Cell { value: ceiling.or(floor), text }
}

fn score(scores: Option<&ReferenceScores>, scene: &ReleasedScene, key: ResultKey) -> Option<f64> {
    scores?.of_scene(&scene.scene)?.get(&key).copied()
}

fn findings(scene: &ReleasedScene) -> Cell {
    let count = |severity| scene.findings.iter().filter(|finding| finding.severity == severity).count();
    let [errors, warnings, notes] = [Severity::Error, Severity::Warning, Severity::Note].map(count);
    let words = [(errors, "error"), (warnings, "warning"), (notes, "note")].into_iter().filter(|(count, _)| *count > 0);
    let words: Vec<String> = words.map(|(count, word)| format!("{count} {word}{}", plural(count))).collect();
    let text = if words.is_empty() { "none".to_owned() } else { words.join(", ") };
    Cell { value: Some((1_000_000 * errors + 1000 * warnings + notes) as f64), text }
}

fn views(scene: &ReleasedScene) -> Vec<[String; 3]> {
    let row = |view: &super::renders::ViewNoise| {
        let psnr = view.mean_of_halves_psnr_db.map_or_else(|| "no noise".to_owned(), |db| format!("{db:.2} dB"));
        [view.view.to_string(), psnr, format!("{:.2e}", view.denoised_mse)]
    };
    scene.noise.iter().flatten().map(row).collect()
}

fn step(cost: &StepCost) -> [String; 4] {
    let name = match (cost.step, &cost.renderer) {
        (Step::Build, _) => "build".to_owned(),
        (Step::Render, Some(renderer)) => format!("render, {renderer}"),
        (Step::Render, None) => "render".to_owned(),
        (Step::Scorer, _) => "scorer's reference".to_owned(),
    };
    let cpu = cost.cpu_seconds.map_or_else(|| "not known".to_owned(), duration);
    [name, cost.runs.to_string(), duration(cost.wall_seconds), cpu]
}

/// Every PSNR on all surfaces: its name, the floor's and the ceiling's.
fn all_scores(file: &ReleaseFile, scene: &ReleasedScene) -> Vec<[String; 3]> {
    let of = |scores: &'_ Option<ReferenceScores>, key: ResultKey| {
        let value = score(scores.as_ref(), scene, key);
        value.map_or_else(|| "–".to_owned(), |value| key.metric.style().text(value))
    };
    let is_shown = |key: &&ResultKey| key.metric == Metric::Psnr && key.picture.surfaces == Surfaces::All;
    let both = [&file.ceiling, &file.floor].into_iter().flatten();
    let keys: std::collections::BTreeSet<ResultKey> = both
        .filter_map(|scores| scores.of_scene(&scene.scene))
        .flat_map(|values| values.keys())
        .filter(is_shown)
        .copied()
        .collect();
    keys.into_iter().map(|key| [title(key), of(&file.floor, key), of(&file.ceiling, key)]).collect()
}

/// As in `Albedo, novel views`.
pub(crate) fn title(key: ResultKey) -> String {
    format!("{}, {}", key.picture.kind.title(), key.views.title().to_lowercase())
}

/// The standard error of each score of light of the ceiling that has one.
fn ceiling_errors(file: &ReleaseFile, scene: &ReleasedScene) -> Vec<String> {
    let noise = file.ceiling.as_ref().and_then(|scores| scores.noise.as_ref()?.get(&scene.scene));
    let is_shown = |key: &ResultKey| key.picture.surfaces == Surfaces::All;
    let line = |(key, error): (&ResultKey, &f64)| format!("{}: {error:.3} dB", title(*key));
    noise.into_iter().flatten().filter(|(key, _)| is_shown(key)).map(line).collect()
}
