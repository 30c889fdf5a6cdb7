//! The board itself: one row for each method, one column for each number and each fact.

use std::collections::BTreeMap;

use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::board::Board;
use super::columns::{Choices, Column, choices};
use super::facts::{FACTS, Fact, FactColumn, facts};
use super::heads::{Cell, MethodHead, rank_text, standing};
use super::site::{Page, SiteWriter};
use crate::error::ReportError;
use mateval_eval::result_key::ResultKey;

use crate::ranking::file::{KeyRanking, RankedMethod, Standing};
use crate::truth_noise::{self, Measured, close_pairs};

#[derive(Serialize)]
struct BoardPage<'a> {
    columns: &'a [Column],
    facts: [FactColumn; FACTS.len()],
    choices: Choices,
    first: &'a Column,
    rows: Vec<Row<'a>>,
    ceiling: Option<CeilingRow<'a>>,
    /// One sentence a column, on methods that are closer to each other than the noise of the truth's pictures.
    too_close: Vec<String>,
    has_intervals: bool,
    has_tables: bool,
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

/// Writes `index.html`, and one script for each number with the comparison of all pairs of methods.
pub(super) fn write(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let Some(first) = board.first() else {
        let protocol = board.ranking().protocol.clone();
        return Err(ReportError::NothingToShow { protocol, output: "a leaderboard" });
    };
    let mut rows: Vec<Row<'_>> = (0..board.heads.len()).map(|at| row(board, at, first)).collect();
    let order = |row: &Row<'_>| row.value.map_or(f64::INFINITY, |value| -first.better.sign() * value);
    rows.sort_by(|a, b| order(a).total_cmp(&order(b)));
    let standings = || board.ranking().keys.values().flat_map(|key| &key.standings);
    let page = BoardPage {
        columns: &board.columns,
        facts: FACTS,
        choices: choices(&board.columns),
        first,
        rows,
        ceiling: ceiling_row(board),
        too_close: board.columns.iter().filter_map(|column| too_close(board, column)).collect(),
        has_intervals: standings().any(|standing| standing.interval.is_some()),
        has_tables: site.path(super::downloads::TABLES).exists(),
    };
    site.page(&Page {
        file: "index.html",
        template: "board.j2",
        title: &format!("{} {} leaderboard", board.file.dataset.name, board.file.dataset.version),
        scripts: &["sort.js", "board.js"],
        values: context! { board => Serde(&page) },
    })?;
    for column in &board.columns {
        if let Some(key) = board.ranking().keys.get(&column.key) {
            site.file(&format!("wins/{}.js", column.key), &wins(column.key, key, &board.ranking().methods))?;
        }
    }
    Ok(())
}

/// The row of the method at place `at`.
fn row<'a>(board: &'a Board<'_>, at: usize, first: &Column) -> Row<'a> {
    let head = &board.heads[at];
    let of = |column: &Column| standing(board.ranking(), column.key, &head.id);
    let cells = board.columns.iter().map(|column| of(column).map(|standing| Cell::new(column, standing)));
    let first = of(first);
    Row {
        method: head,
        rank: first.map_or_else(String::new, |standing| rank_text(standing.rank)),
        cells: cells.collect(),
        facts: facts(&board.file.methods[at], board.scores[at]),
        value: first.map(|standing| standing.value),
    }
}

fn ceiling_row<'a>(board: &'a Board<'_>) -> Option<CeilingRow<'a>> {
    let ceiling = board.file.ceiling.as_ref()?;
    let cell = |column: &Column| ceiling.values.get(&column.key).map(|value| column.text(*value));
    Some(CeilingRow { name: &ceiling.method, cells: board.columns.iter().map(cell).collect() })
}

/// A sentence on the methods that the noise of the truth cannot tell apart by a column; none without such.
fn too_close(board: &Board<'_>, column: &Column) -> Option<String> {
    let methods = board.heads.iter().zip(&board.scores).filter_map(|(head, scores)| {
        let psnr = standing(board.ranking(), column.key, &head.id)?.value;
        let truth_noise = truth_noise::of_dataset(scores, &column.key)?;
        Some(Measured { method: &head.name, psnr, truth_noise })
    });
    let texts: Vec<String> = close_pairs(methods.collect()).iter().map(ToString::to_string).collect();
    (!texts.is_empty()).then(|| format!("{} {}: {}.", column.title, column.metric_title, texts.join("; ")))
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
