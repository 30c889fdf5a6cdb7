//! Shows the comparison as tables, whose numbers are rounded while the JSON has all digits.

use mateval_dataset::progress::{Table, fitted, row};
use mateval_files::untrusted;

use super::file::{
    Check, CompareFile, LightComparison, Quantity, SamplesToDecide, SceneComparison, State, ViewComparison,
};

/// The most scenes for which every view and picture has a row of its own.
const SCENES_IN_FULL: usize = 3;

/// The most checks that are printed where they do not agree; the page of a scene lists them all.
const MOST_FAULTS: usize = 40;

/// The tables, then the checks that do not agree, then the verdict, for a terminal of `columns`; of any width if absent.
pub fn text(file: &CompareFile, columns: Option<usize>) -> String {
    let tables = match file.scenes.len() {
        ..=SCENES_IN_FULL => vec![geometry(file), light(file), apart(file)],
        _ => vec![scenes(file)],
    };
    let tables = tables.iter().map(|table| table.text(columns)).collect::<Vec<_>>().join("\n");
    let faults = faults(file);
    let mut lines: Vec<String> = faults.iter().take(MOST_FAULTS).map(|fault| format!("{fault}\n")).collect();
    if faults.len() > MOST_FAULTS {
        lines.push(format!("{} more; --out and --format json list them all\n", faults.len() - MOST_FAULTS));
    }
    let gap = if lines.is_empty() { "" } else { "\n" };
    let rest = format!("{gap}{}\n{}\n", lines.concat(), verdict(file));
    tables
        + &match columns {
            Some(columns) => fitted(&rest, columns),
            None => rest,
        }
}

/// One line for every check that speaks against the pictures. Those that decide nothing are counted by [`verdict`].
pub fn faults(file: &CompareFile) -> Vec<String> {
    let faults = file.checks().filter(|(_, _, check)| check.state.is_fault());
    faults.map(|(scene, view, check)| format!("{scene} {view}: {check}")).collect()
}

/// The verdict in one line.
pub fn verdict(file: &CompareFile) -> String {
    if file.scenes.is_empty() {
        return "nothing was compared: every scene has a photo from elsewhere".to_owned();
    }
    let verdict = if file.agrees { "agrees" } else { "does NOT agree" };
    let checks: Vec<&Check> = file.checks().map(|(_, _, check)| check).collect();
    format!("{} {verdict} with the built-in tracer: {}", file.renderer, counted(&checks, &file.renderer))
}

/// As in "70 of 75 checks agree, 5 undecided (too noisy): 256 samples ... would decide 5".
pub(super) fn counted(checks: &[&Check], renderer: &str) -> String {
    let count = |state: State| checks.iter().filter(|check| check.state == state).count();
    let faults = [(State::Differs, "differ"), (State::Missing, "missing"), (State::Unreadable, "unreadable")];
    let mut parts = vec![format!("{} of {} checks agree", count(State::Agrees), checks.len())];
    parts.extend(
        faults
            .map(|(state, word)| (count(state), word))
            .iter()
            .filter(|(n, _)| *n > 0)
            .map(|(n, word)| format!("{n} {word}")),
    );
    let open =
        [(State::TooNoisy, "too noisy"), (State::TooFew, "of too few samples"), (State::Undecided, "without pixels")];
    let open = open.map(|(state, word)| (count(state), word));
    let reasons: Vec<String> = open.iter().filter(|(n, _)| *n > 0).map(|(n, word)| format!("{n} {word}")).collect();
    if !reasons.is_empty() {
        let all: usize = open.iter().map(|(n, _)| n).sum();
        parts.push(format!("{all} undecided ({})", reasons.join(", ")));
    }
    let decidable: Vec<SamplesToDecide> = checks.iter().filter_map(|check| check.to_decide).collect();
    let most = |of: fn(&SamplesToDecide) -> u32| decidable.iter().map(of).max().unwrap_or_default();
    let hint = match decidable.len() {
        0 => String::new(),
        n => format!(
            "; {} samples per pixel of each half of {renderer}'s, and {} of the built-in tracer's, would decide {n}",
            most(|needed| needed.theirs),
            most(|needed| needed.ours)
        ),
    };
    parts.join(", ") + &hint
}

/// One row per scene.
fn scenes(file: &CompareFile) -> Table {
    let mut rows = vec![row(["scene", "verdict", "agree", "differ", "undecided", "samples"])];
    for scene in &file.scenes {
        let counts = Counts::of(scene);
        rows.push(row([
            scene.scene.as_str(),
            counts.word(),
            &counts.agree.to_string(),
            &counts.faults.to_string(),
            &counts.open.to_string(),
            &scene.samples_each_half().to_string(),
        ]));
    }
    Table {
        title: "Checks by scene; samples: of each half of the built-in tracer's pictures".to_owned(),
        words: 2,
        rows,
    }
}

/// The outcomes of a scene's checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) agree: usize,
    pub(super) faults: usize,
    pub(super) open: usize,
}

impl Counts {
    pub(super) fn of(scene: &SceneComparison) -> Self {
        let checks = || scene.views.iter().flat_map(|view| &view.checks);
        let count = |is: fn(State) -> bool| checks().filter(|check| is(check.state)).count();
        Self {
            agree: count(|state| state == State::Agrees),
            faults: count(State::is_fault),
            open: count(State::is_open),
        }
    }

    pub(super) fn word(self) -> &'static str {
        match (self.faults, self.open) {
            (0, 0) => "agrees",
            (0, _) => "agrees in part",
            _ => "does NOT agree",
        }
    }
}

fn views(file: &CompareFile) -> impl Iterator<Item = (&SceneComparison, &ViewComparison)> {
    file.scenes.iter().flat_map(|scene| scene.views.iter().map(move |view| (scene, view)))
}

fn geometry(file: &CompareFile) -> Table {
    let mut rows = vec![row(["scene", "view", "base colour", "instances", "edges", "parts", "depth", "normals"])];
    rows[0].push("group sums".to_owned());
    for (scene, view) in views(file) {
        let cell = |picture: &str, quantity: Quantity, unit: &dyn Fn(f64) -> String| {
            let check = view.check(picture, quantity);
            let other = || view.checks.iter().find(|check| check.picture == picture || check.picture == "render");
            check.or_else(other).map_or_else(|| "none".to_owned(), |check| shown(check, unit))
        };
        let share = |share: f64| format!("{:.2} %", 100.0 * share);
        let sums = ["rgb_a", "rgb_b"].map(|half| view.check(half, Quantity::GroupSum).and_then(|check| check.measured));
        let sum =
            sums.into_iter().flatten().fold(None, |most: Option<f64>, sum| Some(most.map_or(sum, |m| m.max(sum))));
        let mut cells = row([
            scene.scene.as_str(),
            view.view.as_str(),
            &cell("base_color", Quantity::PsnrDb, &|db| format!("{db:.1} dB")),
            &cell("instance", Quantity::EqualShare, &share),
            &cell("silhouette", Quantity::EqualShare, &share),
            &cell("part", Quantity::EqualShare, &share),
            &cell("depth", Quantity::MedianM, &|m| format!("{:.3} mm", 1e3 * m)),
            &cell("normal", Quantity::MedianDeg, &|deg| format!("{deg:.2} deg")),
        ]);
        cells.push(sum.map_or_else(|| "none".to_owned(), |sum| format!("{sum:.0e}")));
        rows.push(cells);
    }
    Table { title: "Pictures without light, and whether a half's groups sum to it".to_owned(), words: 2, rows }
}

fn shown(check: &Check, unit: &dyn Fn(f64) -> String) -> String {
    let mark = if check.state == State::Differs { "!" } else { "" };
    check.measured.map_or_else(|| check.state.word().to_owned(), |measured| unit(measured) + mark)
}

fn light(file: &CompareFile) -> Table {
    let head =
        ["scene", "view", "picture", "state", "mean off", "error", "over", "tiles", "allowed", "apart", "median"];
    let mut rows = vec![row(head)];
    rows[0].push("noise".to_owned());
    for (scene, view) in views(file) {
        for light in &view.light {
            let words = [scene.scene.as_str(), view.view.as_str(), &name(light), state(view, light).word()];
            let [off, error] = light.mean.map_or([None; 2], |mean| [mean.difference, mean.standard_error]);
            let off = off.map_or_else(|| "none".to_owned(), |off| format!("{:+.2} %", 100.0 * off));
            let apart = light.apart.iter().map(|apart| apart.count).sum::<usize>();
            let counts = [light.tiles.over, light.tiles.count, light.tiles.allowed, apart];
            let noise = light.tiles.noise.map_or_else(|| "none".to_owned(), |noise| format!("{noise:.1}"));
            let mut cells = row(words);
            cells.extend([off, percent(error)]);
            cells.extend(counts.map(|count| count.to_string()));
            cells.extend([percent(light.tiles.median), noise]);
            rows.push(cells);
        }
    }
    let mut bounds: Vec<f64> = file.scenes.iter().map(|scene| scene.tile_bound).collect();
    bounds.sort_by(f64::total_cmp);
    bounds.dedup();
    let bounds: Vec<String> = bounds.iter().map(|bound| format!("{} %", 100.0 * bound)).collect();
    let title = format!(
        "Pictures of light. mean off: difference of the means, error: its standard error; over: tiles off by more than {} \
         plus 3 standard errors; apart: tiles that do not count; noise: 3 standard errors of a tile / bound",
        bounds.join(" or ")
    );
    Table { title, words: 4, rows }
}

/// The worse state of the picture's two checks.
fn state(view: &ViewComparison, light: &LightComparison) -> State {
    let state = |quantity| view.check(&light.picture, quantity).map_or(State::Undecided, |check| check.state);
    let states = [state(Quantity::TilesOver), state(Quantity::MeanDifference)];
    let order = [State::Differs, State::TooNoisy, State::TooFew, State::Undecided];
    order.into_iter().find(|state| states.contains(state)).unwrap_or(State::Agrees)
}

fn name(light: &LightComparison) -> String {
    match &light.light {
        Some(name) => format!("{} {}", light.picture, untrusted::shown(name, 24)),
        None => light.picture.clone(),
    }
}

/// The tiles of RGB that do not count for the verdict.
fn apart(file: &CompareFile) -> Table {
    let mut rows = vec![row(["scene", "view", "kind", "tiles", "over", "median", "largest"])];
    for (scene, view) in views(file) {
        for apart in view.light.iter().filter(|light| light.light.is_none()).flat_map(|light| &light.apart) {
            rows.push(row([
                scene.scene.as_str(),
                view.view.as_str(),
                apart.kind.word(),
                &apart.count.to_string(),
                &apart.over.to_string(),
                &percent(apart.median),
                &apart.largest.map_or_else(|| "none".to_owned(), |off| format!("{:+.1} %", 100.0 * off)),
            ]));
        }
    }
    Table {
        title: "Tiles of RGB that show materials known to differ; they do not count for the verdict".to_owned(),
        words: 3,
        rows,
    }
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "none".to_owned(), |share| format!("{:.2} %", 100.0 * share))
}
