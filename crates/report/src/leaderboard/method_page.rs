//! The page of a method: all of its scores, comparisons with the others, scores by scene and category, and its worst
//! cases.

use std::collections::BTreeMap;

use mateval_dataset::SceneId;
use mateval_eval::metric::{Metric, PictureKind};
use mateval_eval::result::InstancePixelErrors;
use mateval_eval::result::key::{ResultKey, Views};
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::board::{Board, Comparison, comparisons};
use super::columns::{Cell, Column, MethodHead, headlines, shown, standing};
use super::marks::Verified;
use super::site::{Page, SiteWriter};
use crate::error::ReportError;
use crate::ranking::file::Pair;
use crate::tables::{CellKey, Grouping, Value, pooled};

/// The numbers of worst scenes and instances that are shown.
const WORST_SCENES: usize = 5;
const WORST_INSTANCES: usize = 10;

/// The most scenes whose pictures the page opens with.
const PICTURED_SCENES: usize = 2;

/// The most findings that a page lists.
const FINDINGS: usize = 100;

#[derive(Serialize)]
struct MethodPage<'a> {
    method: &'a MethodHead,
    verified_text: &'static str,
    submission_sha256: &'a str,
    tool: &'a str,
    headlines: Vec<Headline<'a>>,
    /// Its pictures in the first scenes that have some.
    pictures: Vec<ScenePictures<'a>>,
    metrics: Vec<&'static str>,
    scores: Vec<ScoreRow<'a>>,
    first: Option<&'a Column>,
    duels: Vec<DuelRow<'a>>,
    worst_scenes: Vec<WorstScene<'a>>,
    worst_instances: Vec<WorstInstance<'a>>,
    categories: Vec<CategoryTable>,
    columns: Vec<&'a Column>,
    scenes: Vec<SceneRow<'a>>,
    findings: Vec<String>,
    finding_count: usize,
}

/// One of the numbers that the page opens with.
#[derive(Serialize)]
struct Headline<'a> {
    column: &'a Column,
    cell: Option<Cell>,
}

#[derive(Serialize)]
struct ScenePictures<'a> {
    scene: &'a SceneId,
    pictures: Vec<Comparison<'a>>,
    has_room: bool,
}

#[derive(Serialize)]
struct ScoreRow<'a> {
    title: &'a str,
    cells: Vec<Option<Cell>>,
}

#[derive(Serialize)]
struct DuelRow<'a> {
    id: &'a str,
    name: &'a str,
    difference: Option<f64>,
    difference_text: String,
    win: Option<f64>,
    win_text: String,
    p: Option<f64>,
    p_text: String,
    verdict: &'static str,
}

#[derive(Serialize)]
struct WorstScene<'a> {
    id: &'a str,
    text: String,
}

#[derive(Serialize)]
struct WorstInstance<'a> {
    scene: &'a str,
    instance: &'a str,
    category: &'a str,
    pixels: usize,
    mse: String,
    share: String,
}

#[derive(Serialize)]
struct CategoryTable {
    title: &'static str,
    /// Views and metric.
    heads: Vec<[&'static str; 2]>,
    rows: Vec<CategoryRow>,
}

#[derive(Serialize)]
struct CategoryRow {
    name: String,
    cells: Vec<Option<String>>,
}

#[derive(Serialize)]
struct SceneRow<'a> {
    id: &'a str,
    cells: Vec<Option<String>>,
}

/// Writes `methods/<id>.html` of the method at place `at`.
pub(super) fn write(board: &Board<'_>, at: usize, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let (head, result, scores) = (&board.heads[at], &board.results[at], board.scores[at]);
    let columns = headlines(&board.columns);
    let page = MethodPage {
        method: head,
        verified_text: verified_text(head.verified),
        submission_sha256: &result.submission.sha256,
        tool: &result.tool,
        headlines: shown(&board.columns).into_iter().map(|column| headline(board, &head.id, column)).collect(),
        pictures: pictures(board, head, site),
        metrics: Metric::ALL.iter().map(|metric| metric.style().title).collect(),
        scores: score_rows(board, &head.id),
        first: board.first(),
        duels: if board.has_intervals() { duels(board, &head.id) } else { Vec::new() },
        worst_scenes: worst_scenes(board, at),
        worst_instances: worst_instances(&scores.instances),
        categories: categories(&scores.instances),
        scenes: scene_rows(board, at, &columns),
        columns,
        findings: result.findings.iter().take(FINDINGS).map(ToString::to_string).collect(),
        finding_count: result.findings.len(),
    };
    site.page(&Page {
        file: &format!("methods/{}.html", head.id),
        template: "method.j2",
        title: &head.name,
        scripts: &["sort.js", "slider.js"],
        values: context! { page => Serde(&page) },
    })
}

fn verified_text(verified: Verified) -> &'static str {
    match verified {
        Verified::Claimed => "no: its numbers are claimed by those who submitted it",
        Verified::Confirmed => "yes: eval verify computed the same numbers",
        Verified::Refuted => "no: eval verify computed different numbers",
        Verified::Stale => "no: the result has changed since it was verified",
    }
}

fn headline<'a>(board: &Board<'_>, id: &str, column: &'a Column) -> Headline<'a> {
    let standing = standing(board.ranking(), column.key, id);
    Headline { column, cell: standing.map(|standing| Cell::new(column, standing)) }
}

fn pictures<'a>(board: &'a Board<'_>, head: &'a MethodHead, site: &SiteWriter<'_>) -> Vec<ScenePictures<'a>> {
    let of_scene = |scene| ScenePictures {
        scene,
        pictures: comparisons(board, site, head, scene),
        has_room: board.has_room(scene, &head.id),
    };
    let scenes = board.ranking().scenes.iter().map(of_scene);
    scenes.filter(|scene| !scene.pictures.is_empty()).take(PICTURED_SCENES).collect()
}

/// One row for each picture and views, one column for each metric.
fn score_rows<'a>(board: &'a Board<'_>, id: &str) -> Vec<ScoreRow<'a>> {
    let mut rows: Vec<ScoreRow<'a>> = Vec::new();
    for column in &board.columns {
        let Some(standing) = standing(board.ranking(), column.key, id) else { continue };
        if rows.last().is_none_or(|row| row.title != column.title) {
            rows.push(ScoreRow { title: &column.title, cells: Metric::ALL.iter().map(|_| None).collect() });
        }
        let place = Metric::ALL.iter().position(|metric| *metric == column.key.metric);
        if let Some((row, place)) = rows.last_mut().zip(place) {
            row.cells[place] = Some(Cell::new(column, standing));
        }
    }
    rows
}

/// Comparisons with every other method, by the score that the board is sorted by initially.
fn duels<'a>(board: &'a Board<'_>, id: &str) -> Vec<DuelRow<'a>> {
    let Some(column) = board.first() else { return Vec::new() };
    let pairs = board.ranking().keys.get(&column.key).map_or(&[][..], |key| &key.pairs);
    let duel = |pair: &Pair| {
        let is_first = pair.first == id;
        let other = if is_first { &pair.second } else { &pair.first };
        let head = board.heads.iter().find(|head| head.id == *other)?;
        let difference = pair.difference.map(|difference| if is_first { difference } else { -difference });
        let win = pair.win.map(|win| if is_first { win } else { 1.0 - win });
        let difference_text = difference.map_or_else(String::new, |value| {
            if value > 0.0 { format!("+{}", column.text(value)) } else { column.text(value) }
        });
        Some(DuelRow {
            id: &head.id,
            name: &head.name,
            difference,
            difference_text,
            win,
            win_text: win.map_or_else(String::new, |win| format!("{:.1} %", 100.0 * win)),
            p: pair.p_holm,
            p_text: pair.p_holm.map_or_else(String::new, |p| format!("{p:.4}")),
            verdict: match win {
                None => "too few houses",
                Some(_) if !pair.is_significant() => "not significant",
                Some(win) if win > 0.5 => "better",
                Some(_) => "worse",
            },
        })
    };
    pairs.iter().filter(|pair| pair.first == id || pair.second == id).filter_map(duel).collect()
}

fn worst_scenes<'a>(board: &'a Board<'_>, at: usize) -> Vec<WorstScene<'a>> {
    let Some(column) = board.first() else { return Vec::new() };
    let values = board.scores[at].scenes.iter();
    let mut scenes: Vec<(&str, f64)> =
        values.filter_map(|(scene, values)| Some((scene.as_str(), *values.get(&column.key)?))).collect();
    scenes.sort_by(|a, b| (column.better.sign() * a.1).total_cmp(&(column.better.sign() * b.1)));
    scenes.truncate(WORST_SCENES);
    scenes.into_iter().map(|(id, value)| WorstScene { id, text: column.text(value) }).collect()
}

/// The instances that contribute most to the squared error of albedo in novel views.
fn worst_instances(instances: &[InstancePixelErrors]) -> Vec<WorstInstance<'_>> {
    // After noise removal an error can be below 0.
    let error = |errors: &InstancePixelErrors| errors.mse.max(0.0) * errors.pixels as f64;
    let mut found: Vec<&InstancePixelErrors> = instances
        .iter()
        .filter(|errors| errors.picture == PictureKind::Albedo && errors.views == Views::Novel)
        .collect();
    let all: f64 = found.iter().map(|errors| error(errors)).sum();
    found.sort_by(|a, b| error(b).total_cmp(&error(a)));
    found.truncate(WORST_INSTANCES);
    let rows = found.into_iter().filter(|errors| errors.mse > 0.0).map(|errors| WorstInstance {
        scene: errors.scene.as_str(),
        instance: errors.instance.as_str(),
        category: errors.category.as_deref().unwrap_or(""),
        pixels: errors.pixels,
        mse: Metric::Mse.style().text(errors.mse),
        share: format!("{:.1}", 100.0 * error(errors) / all),
    });
    rows.collect()
}

/// Albedo by category and by broader category.
fn categories(instances: &[InstancePixelErrors]) -> Vec<CategoryTable> {
    let key = |views, metric| ResultKey::whole(PictureKind::Albedo, views, metric);
    let views = [Views::Input, Views::Novel, Views::Unobserved];
    let columns: Vec<ResultKey> =
        views.into_iter().flat_map(|views| [Metric::Mse, Metric::Psnr].map(|metric| key(views, metric))).collect();
    let table = |(title, grouping)| {
        let cells = |values: &BTreeMap<CellKey, Value>| {
            let cell = |key: &ResultKey| {
                let value = values.get(&CellKey::from(*key))?.value;
                Some(key.metric.style().text(value))
            };
            columns.iter().map(cell).collect::<Vec<_>>()
        };
        let rows = pooled(instances, grouping);
        let rows = rows.iter().map(|(name, values)| CategoryRow { name: name.clone(), cells: cells(values) });
        CategoryTable {
            title,
            heads: columns.iter().map(|key| [key.views.title(), key.metric.style().title]).collect(),
            rows: rows.filter(|row| row.cells.iter().any(Option::is_some)).collect(),
        }
    };
    let tables = [("Albedo by super-category", Grouping::SuperCategory), ("Albedo by category", Grouping::Category)];
    tables.map(table).into_iter().filter(|table| !table.rows.is_empty()).collect()
}

fn scene_rows<'a>(board: &'a Board<'_>, at: usize, columns: &[&Column]) -> Vec<SceneRow<'a>> {
    let row = |scene: &'a SceneId| SceneRow { id: scene.as_str(), cells: board.texts(at, scene, columns) };
    board.ranking().scenes.iter().map(row).collect()
}
