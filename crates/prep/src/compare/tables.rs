//! Shows the comparison as tables, whose numbers are rounded while the JSON has all digits.

use mateval_dataset::progress::{Table, fitted, row};
use mateval_files::untrusted;

use super::file::{Check, CompareFile, LightComparison, Quantity, SceneComparison, State, ViewComparison};

/// The tables, then every check that does not agree, then the verdict, for a terminal of `columns`; of any width if
/// absent.
pub fn text(file: &CompareFile, columns: Option<usize>) -> String {
    let tables =
        [geometry(file), light(file), apart(file), source_materials(file)].map(|table| table.text(columns)).join("\n");
    let faults: String = faults(file).iter().map(|fault| format!("{fault}\n")).collect();
    let gap = if faults.is_empty() { "" } else { "\n" };
    let rest = format!("{gap}{faults}\n{}\n", verdict(file));
    tables
        + &match columns {
            Some(columns) => fitted(&rest, columns),
            None => rest,
        }
}

/// One line for every check that does not agree.
pub fn faults(file: &CompareFile) -> Vec<String> {
    let faults = file.checks().filter(|(_, _, check)| check.state != State::Agrees);
    faults.map(|(scene, view, check)| format!("{scene} {view}: {check}")).collect()
}

/// The verdict in one line.
pub fn verdict(file: &CompareFile) -> String {
    if file.scenes.is_empty() {
        return "nothing was compared: every scene has a photo from elsewhere".to_owned();
    }
    let count = |state: State| file.checks().filter(|(_, _, check)| check.state == state).count();
    let all = file.checks().count();
    let others = [
        (State::Differs, "differ"),
        (State::TooNoisy, "too noisy"),
        (State::Undecided, "undecided"),
        (State::Missing, "missing"),
        (State::Unreadable, "unreadable"),
    ];
    let others = others.into_iter().map(|(state, word)| (count(state), word)).filter(|(count, _)| *count > 0);
    let others: Vec<String> = others.map(|(count, word)| format!("{count} {word}")).collect();
    let rest = if others.is_empty() { String::new() } else { format!(", {}", others.join(", ")) };
    let verdict = if file.agrees { "agrees" } else { "does NOT agree" };
    format!(
        "{} {verdict} with the built-in tracer: {} of {all} checks agree{rest}",
        file.renderer,
        count(State::Agrees)
    )
}

fn views(file: &CompareFile) -> impl Iterator<Item = (&SceneComparison, &ViewComparison)> {
    file.scenes.iter().flat_map(|scene| scene.views.iter().map(move |view| (scene, view)))
}

fn geometry(file: &CompareFile) -> Table {
    let mut rows = vec![row(["scene", "view", "base colour", "instances", "parts", "depth", "normals", "group sums"])];
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
        rows.push(row([
            scene.scene.as_str(),
            view.view.as_str(),
            &cell("base_color", Quantity::PsnrDb, &|db| format!("{db:.1} dB")),
            &cell("instance", Quantity::EqualShare, &share),
            &cell("part", Quantity::EqualShare, &share),
            &cell("depth", Quantity::MedianM, &|m| format!("{:.3} mm", 1e3 * m)),
            &cell("normal", Quantity::MedianDeg, &|deg| format!("{deg:.2} deg")),
            &sum.map_or_else(|| "none".to_owned(), |sum| format!("{sum:.0e}")),
        ]));
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
    let order = [State::Differs, State::TooNoisy, State::Undecided];
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

/// How far the converted materials are from the source's own.
fn source_materials(file: &CompareFile) -> Table {
    let mut rows = vec![row(["scene", "view", "PSNR", "mean off", "tiles", "over", "median", "worst"])];
    for scene in &file.scenes {
        let Some(source) = &scene.source_materials else { continue };
        let signed = |off: Option<f64>| off.map_or_else(|| "none".to_owned(), |off| format!("{:+.2} %", 100.0 * off));
        let tiles = &source.light.tiles;
        rows.push(row([
            scene.scene.as_str(),
            source.view.as_str(),
            &source.psnr_db.map_or_else(|| "none".to_owned(), |db| format!("{db:.1} dB")),
            &signed(source.light.mean.and_then(|mean| mean.difference)),
            &tiles.count.to_string(),
            &tiles.over.to_string(),
            &percent(tiles.median),
            &signed(tiles.worst.and_then(|worst| worst.off.difference)),
        ]));
    }
    let title = "The source's own materials against the converted ones, both by the built-in tracer; no check";
    Table { title: title.to_owned(), words: 2, rows }
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "none".to_owned(), |share| format!("{:.2} %", 100.0 * share))
}
