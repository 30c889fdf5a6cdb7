//! A table before it is written: the numbers of each method, in groups; heads, cells, and which of them are best.

use std::collections::BTreeMap;

use mateval_dataset::{SceneId, SourceKind};
use mateval_eval::metric::{Better, Metric, PictureKind};
use mateval_eval::result::Constancy;
use mateval_eval::result::key::{PictureName, ResultKey, Views};
use mateval_eval::result::{InstancePixelErrors, ProtocolResult, ResultFile};
use mateval_metrics::Psnr;

use super::layouts::{CellKey, Grouping, Layout, Quantity, Value, constancy_values};

/// One method's numbers.
pub(super) struct Row {
    method: String,
    values: BTreeMap<CellKey, Value>,
    /// The stems of maps that its submission never contains, which have no values.
    not_predicted: Vec<String>,
}

impl Row {
    /// Whether the row could have this number: its submission contains the map that the number is about.
    fn predicts(&self, key: &CellKey) -> bool {
        key.picture.kind.map().is_none_or(|map| !self.not_predicted.iter().any(|stem| stem == map.stem()))
    }
}

/// Rows that are compared with each other.
pub(super) struct Group {
    /// The scene, category or kind of source; empty for the whole dataset.
    name: String,
    rows: Vec<Row>,
    /// The truth's own numbers, which no method is expected to exceed.
    ceiling: Option<Row>,
}

/// The groups, with methods in the order of the results. Scenes are in the dataset's order, categories by name with
/// `other` last.
pub(super) fn groups(
    results: &[ResultFile],
    ceiling: Option<&ResultFile>,
    protocol: &str,
    grouping: Grouping,
) -> Vec<Group> {
    let all = results.iter().chain(ceiling);
    let scored: Vec<(&ResultFile, &ProtocolResult)> =
        all.filter_map(|result| Some((result, result.protocols.get(protocol)?))).collect();
    let group = |name: &str, values: &dyn Fn(usize, &ProtocolResult) -> BTreeMap<CellKey, Value>| {
        let row = |(at, (result, scores)): (usize, &(&ResultFile, &ProtocolResult))| {
            let mut values = values(at, scores);
            let of_group = |family: &&Constancy| grouping == Grouping::Dataset || family.scene.as_str() == name;
            let families: Vec<Constancy> = result.constancy.iter().filter(of_group).cloned().collect();
            let constancy = constancy_values(&families).into_iter();
            values.extend(constancy.map(|(key, value)| (key, Value { value, standard_error: None })));
            Row { method: result.shown_method(), values, not_predicted: result.not_predicted.clone() }
        };
        let mut rows: Vec<Row> = scored.iter().enumerate().map(row).collect();
        let ceiling = ceiling.and_then(|_| rows.pop());
        Group { name: name.to_owned(), rows, ceiling }
    };
    match grouping {
        // The paper's tables hold rooms of 3D-FRONT alone.
        Grouping::Dataset if protocol == "paper" && sources(results).len() > 1 => sources(results)
            .into_iter()
            .map(|(kind, scenes)| group(kind.title(), &|_, scores| of_scenes(scores, &scenes)))
            .collect(),
        Grouping::Dataset => vec![group("", &|_, scores| of_dataset(scores))],
        Grouping::Scene => {
            let scenes = results.first().map_or(&[][..], |result| &result.dataset.scenes);
            scenes.iter().map(|scene| group(scene.as_str(), &|_, scores| of_scene(scores, scene))).collect()
        }
        Grouping::Category | Grouping::SuperCategory => {
            let by_method: Vec<_> = scored.iter().map(|(_, scores)| pooled(&scores.instances, grouping)).collect();
            let mut names: Vec<&String> = by_method.iter().flat_map(BTreeMap::keys).collect();
            names.sort_by_key(|name| (*name == OTHER, *name));
            names.dedup();
            let of = |at: usize, name: &String| by_method[at].get(name).cloned().unwrap_or_default();
            names.into_iter().map(|name| group(name, &|at, _| of(at, name))).collect()
        }
    }
}

/// The scenes of each kind of source.
fn sources(results: &[ResultFile]) -> BTreeMap<SourceKind, Vec<SceneId>> {
    let mut kinds: BTreeMap<SourceKind, Vec<SceneId>> = BTreeMap::new();
    for (scene, kind) in results.iter().flat_map(|result| &result.dataset.sources) {
        let scenes = kinds.entry(*kind).or_default();
        if !scenes.contains(scene) {
            scenes.push(scene.clone());
        }
    }
    kinds
}

/// Means over some of the scenes; the noise of different scenes is independent.
fn of_scenes(scores: &ProtocolResult, scenes: &[SceneId]) -> BTreeMap<CellKey, Value> {
    let mut all: BTreeMap<CellKey, Vec<Value>> = BTreeMap::new();
    for (key, value) in scenes.iter().flat_map(|scene| of_scene(scores, scene)) {
        all.entry(key).or_default().push(value);
    }
    let mean = |values: Vec<Value>| {
        let count = values.len() as f64;
        let squares: Option<f64> = values.iter().map(|value| value.standard_error.map(|error| error * error)).sum();
        Value {
            value: values.iter().map(|value| value.value).sum::<f64>() / count,
            standard_error: squares.map(|squares| squares.sqrt() / count),
        }
    };
    all.into_iter().map(|(key, values)| (key, mean(values))).collect()
}

fn of_dataset(scores: &ProtocolResult) -> BTreeMap<CellKey, Value> {
    let value = |(key, value): (&ResultKey, &f64)| {
        let standard_error = scores.summary_noise.get(key).copied();
        (CellKey::from(*key), Value { value: *value, standard_error })
    };
    scores.summary.iter().map(value).collect()
}

fn of_scene(scores: &ProtocolResult, scene: &SceneId) -> BTreeMap<CellKey, Value> {
    let noise = scores.noise.get(scene);
    let value = |(key, value): (&ResultKey, &f64)| {
        let standard_error = noise.and_then(|noise| noise.get(key)).copied();
        (CellKey::from(*key), Value { value: *value, standard_error })
    };
    scores.scenes.get(scene).into_iter().flatten().map(value).collect()
}

/// The group of instances without a category.
const OTHER: &str = "other";

/// By category: the number of pixels, the mean squared error over all of them, and its PSNR.
///
/// Every pixel has the same weight, regardless of scene, view and instance. Unlike in the other tables, PSNR is that of
/// a mean. It is missing if the error is not above 0 after noise removal.
pub(crate) fn pooled(instances: &[InstancePixelErrors], by: Grouping) -> BTreeMap<String, BTreeMap<CellKey, Value>> {
    let mut sums: BTreeMap<(String, PictureKind, Views), (f64, usize)> = BTreeMap::new();
    for errors in instances.iter().filter(|errors| errors.pixels > 0) {
        let category = if by == Grouping::SuperCategory { &errors.super_category } else { &errors.category };
        let category = category.clone().unwrap_or_else(|| OTHER.to_owned());
        let sum = sums.entry((category, errors.picture, errors.views)).or_default();
        sum.0 += errors.mse * errors.pixels as f64;
        sum.1 += errors.pixels;
    }
    let mut pooled: BTreeMap<String, BTreeMap<CellKey, Value>> = BTreeMap::new();
    for ((category, kind, views), (sum, pixels)) in sums {
        let values = pooled.entry(category).or_default();
        let mut add = |quantity: Quantity, value: f64| {
            let key = CellKey { picture: PictureName::whole(kind), views, quantity };
            values.insert(key, Value { value, standard_error: None });
        };
        let mse = sum / pixels as f64;
        add(Quantity::Pixels, pixels as f64);
        add(Quantity::Score(Metric::Mse), mse);
        if let Some(psnr) = Psnr::from_mse(mse).ok().filter(|psnr| !(kind.is_light() && psnr.exact)) {
            add(Quantity::Score(Metric::Psnr), psnr.db);
        }
    }
    pooled
}

/// A table without empty columns.
pub(super) struct Table<'a> {
    pub(super) title: &'a str,
    /// Head of the column of groups; none if the whole dataset is the only group.
    pub(super) group_head: Option<&'static str>,
    /// Titles of blocks, and the number of columns of each.
    pub(super) blocks: Vec<(&'static str, usize)>,
    pub(super) columns: Vec<Column>,
    pub(super) groups: Vec<TableGroup<'a>>,
}

pub(super) struct Column {
    pub(super) block: &'static str,
    /// Whether any of its values has a standard error.
    pub(super) has_errors: bool,
    pub(super) key: CellKey,
}

/// Rows that are compared with each other.
pub(super) struct TableGroup<'a> {
    pub(super) name: &'a str,
    /// Methods and their cells; the ceiling comes last.
    pub(super) rows: Vec<(String, Vec<Cell>)>,
}

/// One value as it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// Scaled; none if it is missing.
    pub(super) value: Option<Value>,
    /// Whether a value could exist: another method of the group has one, and the submission contains the map.
    pub(super) is_expected: bool,
    pub(super) digits: usize,
    pub(super) mark: Mark,
}

/// The place of a value among those of its group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    Best,
    Second,
    None,
}

impl<'a> Table<'a> {
    /// Fills a layout. Columns and groups without values are left out; none if nothing is left.
    pub(super) fn fill(layout: &'a Layout, grouping: Grouping, groups: &'a [Group]) -> Option<Self> {
        let mut columns: Vec<Column> = Vec::new();
        let mut blocks = Vec::new();
        for block in &layout.blocks {
            let of_block = block.quantities.iter().filter_map(|&quantity| {
                let key = CellKey { picture: block.picture, views: block.views, quantity };
                let rows = groups.iter().flat_map(|group| group.rows.iter().chain(&group.ceiling));
                let mut values = rows.filter_map(|row| row.values.get(&key)).peekable();
                values.peek()?;
                let has_errors = values.any(|value| value.standard_error.is_some());
                Some(Column { block: block.title, has_errors, key })
            });
            let before = columns.len();
            columns.extend(of_block);
            if columns.len() > before {
                blocks.push((block.title, columns.len() - before));
            }
        }
        let filled = groups.iter().filter_map(|group| TableGroup::fill(group, &columns)).collect();
        let group_head = match grouping {
            Grouping::Dataset => groups.iter().any(|group| !group.name.is_empty()).then_some("Source"),
            Grouping::Scene => Some("Scene"),
            Grouping::Category => Some("Category"),
            Grouping::SuperCategory => Some("Super-category"),
        };
        (!columns.is_empty()).then_some(Self { title: &layout.title, group_head, blocks, columns, groups: filled })
    }
}

impl<'a> TableGroup<'a> {
    fn fill(group: &'a Group, columns: &[Column]) -> Option<Self> {
        let by_column: Vec<Vec<Cell>> = columns
            .iter()
            .map(|column| {
                let scaled = |value: &Value| Value { value: value.value * column.key.quantity.style().scale, ..*value };
                let of = |row: &Row| row.values.get(&column.key).map(scaled);
                let values: Vec<_> = group.rows.iter().map(of).collect();
                let is_measured = values.iter().any(Option::is_some);
                let cell = |(row, mark): (&Row, Mark)| Cell {
                    value: of(row),
                    is_expected: is_measured && row.predicts(&column.key),
                    digits: column.key.quantity.style().digits,
                    mark,
                };
                let marks = marks(&values, column.key.quantity.better());
                let rows = group.rows.iter().zip(marks);
                rows.chain(group.ceiling.iter().map(|row| (row, Mark::None))).map(cell).collect()
            })
            .collect();
        if by_column.iter().flatten().all(|cell| cell.value.is_none()) {
            return None;
        }
        let cells = |row: usize| by_column.iter().map(|column| column[row]).collect();
        let names = group.rows.iter().map(|row| row.method.clone());
        let names = names.chain(group.ceiling.iter().map(|row| format!("{} (ceiling)", row.method)));
        let rows = names.enumerate().map(|(at, name)| (name, cells(at))).collect();
        Some(Self { name: &group.name, rows })
    }
}

/// The marks of the best and the second best value. Equal values share a mark, and a single value has none.
fn marks(values: &[Option<Value>], better: Option<Better>) -> Vec<Mark> {
    let mut distinct: Vec<f64> = values.iter().flatten().map(|value| value.value).collect();
    let is_contest = distinct.len() > 1;
    distinct.sort_by(f64::total_cmp);
    if better == Some(Better::Higher) {
        distinct.reverse();
    }
    distinct.dedup();
    let mark = |value: f64| match distinct.iter().position(|other| *other == value) {
        Some(0) if is_contest && better.is_some() => Mark::Best,
        Some(1) if better.is_some() => Mark::Second,
        _ => Mark::None,
    };
    values.iter().map(|value| value.map_or(Mark::None, |value| mark(value.value))).collect()
}

impl Column {
    /// Title of block and metric, and an arrow that shows whether higher or lower is better.
    pub(super) fn head(&self) -> String {
        let arrow = match self.key.quantity.better() {
            Some(Better::Lower) => " ↓",
            Some(Better::Higher) => " ↑",
            None => "",
        };
        format!("{} {}{arrow}", self.block, self.key.quantity.style().title)
    }
}

impl Cell {
    /// The rounded value between its marks, and its standard error after `plus_minus`.
    pub(super) fn text(&self, best: (&str, &str), second: (&str, &str), plus_minus: &str) -> String {
        let (value, digits) = (self.marked_value(best, second), self.digits);
        let standard_error = self.value.and_then(|value| value.standard_error);
        let error = standard_error.map_or_else(String::new, |error| format!(" {plus_minus} {error:.digits$}"));
        format!("{value}{error}")
    }

    /// The rounded value without its standard error; marked if it is the best.
    pub(super) fn value_text(&self, best: (&str, &str)) -> String {
        self.marked_value(best, ("", ""))
    }

    fn marked_value(&self, best: (&str, &str), second: (&str, &str)) -> String {
        let Some(Value { value, .. }) = self.value else {
            return if self.is_expected { "missing" } else { "–" }.to_owned();
        };
        let digits = self.digits;
        let (before, after) = match self.mark {
            Mark::Best => best,
            Mark::Second => second,
            Mark::None => ("", ""),
        };
        format!("{before}{value:.digits$}{after}")
    }
}
