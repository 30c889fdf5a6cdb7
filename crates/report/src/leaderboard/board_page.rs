//! The board itself: one row for each method, one column for each number and each fact; and the same numbers as files,
//! also for the Hugging Face Hub.

use std::borrow::Cow;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use mateval_dataset::{SceneId, json};
use mateval_eval::metric::{Metric, PictureKind};
use mateval_eval::result::key::{ResultKey, Views};
use mateval_eval::result::{ProtocolResult, ResultFile, TracerCheck};
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::board::{Board, Comparison, comparisons};
use super::columns::{
    Cell, Choices, Column, FACTS, Fact, FactColumn, MethodHead, choices, facts, rank_text, shown, standing,
};
use super::entries::Hub;
use super::file::{LEADERBOARD_PATH, LeaderboardFile};
use super::site::{Page, SiteWriter};
use crate::error::ReportError;
use crate::ranking::file::{Interval, KeyRanking, RankedMethod, Standing};
use crate::tables::{Grouping, TableFormat, quoted, tables};

/// The number of methods whose pictures the page opens with.
const BEST: usize = 2;

/// The tables in the paper's layout; not written if no result covers all scenes.
const TABLES: &str = "downloads/tables.tex";

#[derive(Serialize)]
struct BoardPage<'a> {
    best: Option<BestPictures<'a>>,
    /// Those that are shown initially; a script holds the others.
    columns: Vec<&'a Column>,
    facts: [FactColumn; FACTS.len()],
    choices: Choices,
    first: &'a Column,
    rows: Vec<Row<'a>>,
    ceiling: Option<CeilingRow<'a>>,
    tracer: TracerNote,
    has_tables: bool,
}

/// Whether the scorer's tracer, which renders what light is compared with, shows the same rooms as Blender.
#[derive(Serialize)]
struct TracerNote {
    is_good: bool,
    text: String,
}

/// The pictures that the page opens with.
#[derive(Serialize)]
struct BestPictures<'a> {
    scene: &'a SceneId,
    methods: Vec<BestMethod<'a>>,
}

#[derive(Serialize)]
struct BestMethod<'a> {
    method: &'a MethodHead,
    /// Its score by the column that the board is sorted by.
    score: String,
    has_room: bool,
    pictures: Vec<Comparison<'a>>,
}

/// A column that is not shown initially.
#[derive(Serialize)]
struct HiddenColumn<'a> {
    #[serde(flatten)]
    column: &'a Column,
    /// By the ids of methods.
    cells: BTreeMap<&'a str, Cell>,
    ceiling: Option<String>,
}

#[derive(Serialize)]
struct Row<'a> {
    method: &'a MethodHead,
    rank: String,
    cells: Vec<Option<Cell>>,
    facts: Vec<Option<Fact>>,
    #[serde(skip)]
    value: Option<f64>,
}

#[derive(Serialize)]
struct CeilingRow<'a> {
    name: &'a str,
    cells: Vec<Option<String>>,
}

/// Writes `index.html`, a script with the columns that it does not show initially, and one script for each number with
/// the comparison of all pairs of methods.
pub(super) fn write(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let Some(first) = board.first() else {
        let protocol = board.ranking().protocol.clone();
        return Err(ReportError::NothingToShow { protocol, output: "a leaderboard" });
    };
    let columns = shown(&board.columns);
    let rows: Vec<Row<'_>> = board.best_first().into_iter().map(|at| row(board, at, first, &columns)).collect();
    let page = BoardPage {
        best: best_pictures(board, site, first, &rows),
        facts: FACTS,
        choices: choices(&board.columns),
        first,
        rows,
        ceiling: ceiling_row(board, &columns),
        columns,
        tracer: TracerNote::of(board),
        has_tables: site.path(TABLES).exists(),
    };
    site.page(&Page {
        file: "index.html",
        template: "board.j2",
        title: &format!("{} {} leaderboard", board.file.dataset.name, board.file.dataset.version),
        scripts: &["sort.js", "slider.js", "board.js"],
        values: context! { board => Serde(&page) },
    })?;
    site.file("columns.js", &hidden_columns(board))?;
    for column in board.columns.iter().filter(|_| board.has_intervals()) {
        if let Some(key) = board.ranking().keys.get(&column.key) {
            site.file(&format!("wins/{}.js", column.key), &wins(column.key, key, &board.ranking().methods))?;
        }
    }
    Ok(())
}

impl TracerNote {
    /// The check that speaks most against the tracer, as results may state different ones: it is not part of a
    /// dataset's identity.
    fn of(board: &Board<'_>) -> Self {
        let checks = board.results.iter().chain(board.ceiling).filter_map(|result| result.tracer_check.as_ref());
        match checks.max_by_key(|check| (check.informative.saturating_sub(check.agree), Reverse(check.informative))) {
            None => {
                Self { is_good: false, text: "The tracer was not compared with Blender on this dataset.".to_owned() }
            }
            Some(TracerCheck { informative, agree }) => Self {
                is_good: agree == informative,
                text: format!("Tracer and Blender agree in {agree} of {informative} informative checks."),
            },
        }
    }
}

/// The row of the method at place `at`.
fn row<'a>(board: &'a Board<'_>, at: usize, first: &Column, columns: &[&Column]) -> Row<'a> {
    let head = &board.heads[at];
    let of = |column: &Column| standing(board.ranking(), column.key, &head.id);
    let cells = columns.iter().map(|column| of(column).map(|standing| Cell::new(column, standing)));
    let first = of(first);
    Row {
        method: head,
        rank: first.map_or_else(String::new, |standing| rank_text(standing.rank)),
        cells: cells.collect(),
        facts: facts(&board.file.methods[at], board.scores[at]),
        value: first.map(|standing| standing.value),
    }
}

/// The pictures of the best methods that have some in a scene, at most [`BEST`] of them: in the first scene with the
/// most such methods. What was made from the truth is no method. None without pictures.
fn best_pictures<'a>(
    board: &'a Board<'_>,
    site: &SiteWriter<'_>,
    first: &Column,
    rows: &[Row<'a>],
) -> Option<BestPictures<'a>> {
    let methods = || rows.iter().filter(|row| !row.method.oracle);
    let in_scene = |scene: &'a SceneId| {
        let pictures = |row: &Row<'a>| {
            let score = format!("{} {}", first.metric_title, first.text(row.value?));
            let pictures = comparisons(board, site, row.method, scene);
            (!pictures.is_empty()).then_some(BestMethod {
                method: row.method,
                score,
                has_room: board.has_room(scene, &row.method.id),
                pictures,
            })
        };
        BestPictures { scene, methods: methods().filter_map(pictures).take(BEST).collect() }
    };
    let scenes = board.ranking().scenes.iter().map(in_scene).filter(|best| !best.methods.is_empty());
    scenes.min_by_key(|best| Reverse(best.methods.len()))
}

fn ceiling_row<'a>(board: &'a Board<'_>, columns: &[&Column]) -> Option<CeilingRow<'a>> {
    let ceiling = board.file.ceiling.as_ref()?;
    Some(CeilingRow {
        name: &ceiling.method,
        cells: columns.iter().map(|column| ceiling_text(board, column)).collect(),
    })
}

fn ceiling_text(board: &Board<'_>, column: &Column) -> Option<String> {
    board.file.ceiling.as_ref()?.values.get(&column.key).map(|value| column.text(*value))
}

/// A script with the keys of all columns in their order, and the columns that are not shown initially.
fn hidden_columns(board: &Board<'_>) -> String {
    let cell = |column: &Column, id| Some((id, Cell::new(column, standing(board.ranking(), column.key, id)?)));
    let hidden = |column| HiddenColumn {
        column,
        cells: board.heads.iter().filter_map(|head| cell(column, head.id.as_str())).collect(),
        ceiling: ceiling_text(board, column),
    };
    let order: Vec<&ResultKey> = board.columns.iter().map(|column| &column.key).collect();
    let columns: Vec<HiddenColumn<'_>> = board.columns.iter().filter(|column| !column.is_shown).map(hidden).collect();
    // JSON is also valid JavaScript.
    format!("boardColumns({}, {});\n", serde_json::json!(order), serde_json::json!(columns))
}

/// All pairs of methods by one number, row against column: the share of draws that the row's method wins, in percent,
/// and 1 if it is significantly better, -1 if it is significantly worse.
#[derive(Serialize)]
struct Wins<'a> {
    names: Vec<&'a str>,
    wins: Vec<Vec<Option<u32>>>,
    sure: Vec<Vec<i32>>,
}

/// A script that hands the comparison of all pairs to the page, the best method first.
fn wins(key: ResultKey, ranking: &KeyRanking, methods: &[RankedMethod]) -> String {
    let mut standings: Vec<&Standing> = ranking.standings.iter().collect();
    standings.sort_by(|a, b| (ranking.better.sign() * b.value).total_cmp(&(ranking.better.sign() * a.value)));
    let ids: Vec<&str> = standings.iter().map(|standing| standing.method.as_str()).collect();
    let known: BTreeMap<&str, &str> =
        methods.iter().map(|method| (method.id.as_str(), method.method.as_str())).collect();
    let mut table = Wins {
        names: ids.iter().map(|id| known.get(id).copied().unwrap_or(id)).collect(),
        wins: vec![vec![None; ids.len()]; ids.len()],
        sure: vec![vec![0; ids.len()]; ids.len()],
    };
    let place = |id: &str| ids.iter().position(|known| *known == id);
    for pair in &ranking.pairs {
        let (Some(a), Some(b), Some(win)) = (place(&pair.first), place(&pair.second), pair.win) else { continue };
        let percent = (100.0 * win).round() as u32;
        table.wins[a][b] = Some(percent);
        table.wins[b][a] = Some(100 - percent);
        if pair.is_significant() {
            let sign = if win > 0.5 { 1 } else { -1 };
            table.sure[a][b] = sign;
            table.sure[b][a] = -sign;
        }
    }
    // JSON is also valid JavaScript.
    format!("boardWins({}, {});\n", serde_json::json!(key), serde_json::json!(table))
}

/// Writes the numbers of the leaderboard as files.
pub(super) fn write_downloads(board: &Board<'_>, protocol: &str, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    site.file(LEADERBOARD_PATH, &json::to_text(&board.file))?;
    site.file("downloads/leaderboard.csv", &standings_csv(&board.file))?;
    // Tables compare only results that cover the same scenes.
    let scenes = &board.ranking().scenes;
    let is_whole = |result: &&ResultFile| result.dataset.scenes == *scenes;
    let whole: Cow<'_, [ResultFile]> = match board.results.iter().all(|result| is_whole(&result)) {
        true => board.results.into(),
        false => board.results.iter().filter(is_whole).cloned().collect(),
    };
    if !whole.is_empty() {
        for (file, format) in [(TABLES, TableFormat::Latex), ("downloads/tables.csv", TableFormat::Csv)] {
            site.file(file, &tables(&whole, board.ceiling, protocol, Grouping::Dataset, format)?)?;
        }
    }
    for (head, scores) in board.heads.iter().zip(&board.scores) {
        site.file(&format!("methods/{}.csv", head.id), &scenes_csv(scenes, scores))?;
    }
    Ok(())
}

/// The task of `eval.yaml` in a dataset on the Hub.
const HUB_TASK: ResultKey = ResultKey::whole(PictureKind::Albedo, Views::Novel, Metric::Psnr);

/// Writes `README.md`, which makes the site a static Space, and for each method a file for the folder `.eval_results`
/// of its model (<https://huggingface.co/docs/hub/eval-results>). That file has a single number, so its notes state the
/// protocol, the fingerprint, the verification and the interval. Methods made from the ground truth or from perturbed
/// geometry, or ranked on some scenes alone, have none. Texts are written as JSON strings, which YAML reads as they
/// are.
pub(super) fn write_hub(board: &Board<'_>, hub: &Hub, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let quoted = |text: &str| serde_json::Value::from(text).to_string();
    let (dataset, title) = (quoted(&hub.dataset), quoted(site.title()));
    let front = format!("title: {title}\nsdk: static\napp_file: index.html\nlicense: other\ndatasets:\n- {dataset}\n");
    site.file("README.md", &format!("---\n{front}---\n"))?;
    let ranking = board.ranking();
    let task = HUB_TASK.to_string().replace('.', "_");
    let style = &HUB_TASK.metric.row().style;
    for ((ranked, method), result) in ranking.methods.iter().zip(&board.file.methods).zip(board.results) {
        let Some(standing) = standing(ranking, HUB_TASK, &ranked.id) else { continue };
        if method.oracle || ranked.partial || result.submission.geometry.is_some() {
            continue;
        }
        let page = format!("{}/methods/{}.html", hub.url.trim_end_matches('/'), ranked.id);
        let percent = 100.0 * ranking.rules.confidence;
        let interval = standing.interval.map_or_else(
            || "no interval".to_owned(),
            |interval| format!("{percent:.0} % interval {} to {}", style.text(interval.low), style.text(interval.high)),
        );
        let notes = format!(
            "protocol {}, fingerprint {}; {}; {interval}, houses: {}",
            ranking.protocol,
            ranking.fingerprint,
            word(&method.verified),
            standing.houses
        );
        let text = format!(
            "- dataset: {{id: {dataset}, task_id: {task}}}\n  value: {}\n  source: {{url: {}, name: {title}}}\n  notes: {}\n",
            style.text(standing.value),
            quoted(&page),
            quoted(&notes)
        );
        site.file(&format!("downloads/eval_results/{}.yaml", ranked.id), &text)?;
    }
    Ok(())
}

/// One line for each method and key.
fn standings_csv(file: &LeaderboardFile) -> String {
    let mut lines =
        vec!["id,method,key,better,value,low,high,rank_best,rank_worst,scenes,houses,verified,partial".to_owned()];
    for (ranked, method) in file.ranking.methods.iter().zip(&file.methods) {
        for (key, ranking) in &file.ranking.keys {
            let Some(standing) = ranking.standings.iter().find(|standing| standing.method == ranked.id) else {
                continue;
            };
            let end = |of: fn(&Interval) -> f64| {
                standing.interval.as_ref().map_or_else(String::new, |interval| of(interval).to_string())
            };
            lines.push(format!(
                "{},{},{key},{},{},{},{},{},{},{},{},{},{}",
                ranked.id,
                quoted(&ranked.method),
                word(&ranking.better),
                standing.value,
                end(|interval| interval.low),
                end(|interval| interval.high),
                standing.rank.best,
                standing.rank.worst,
                standing.scenes,
                standing.houses,
                word(&method.verified),
                ranked.partial
            ));
        }
    }
    lines.join("\n") + "\n"
}

/// The word for a value in JSON.
fn word<T: serde::Serialize>(value: &T) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

/// One line for each scene, one column for each key.
fn scenes_csv(scenes: &[SceneId], scores: &ProtocolResult) -> String {
    let keys: BTreeSet<&ResultKey> = scores.scenes.values().flat_map(BTreeMap::keys).collect();
    let mut lines = vec![
        std::iter::once("scene".to_owned()).chain(keys.iter().map(ToString::to_string)).collect::<Vec<_>>().join(","),
    ];
    for scene in scenes {
        let values = scores.scenes.get(scene);
        let cells = keys
            .iter()
            .map(|key| values.and_then(|values| values.get(*key)).map_or_else(String::new, |value| value.to_string()));
        lines.push(std::iter::once(scene.to_string()).chain(cells).collect::<Vec<_>>().join(","));
    }
    lines.join("\n") + "\n"
}
