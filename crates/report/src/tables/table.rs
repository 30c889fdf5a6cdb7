//! A table before it is written: heads, cells, and which of them are best.

use mateval_eval::metric::Better;

use super::grouping::Grouping;
use super::layouts::Layout;
use super::rows::{Group, Row};
use super::value::{CellKey, Value};

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

/// A column.
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
