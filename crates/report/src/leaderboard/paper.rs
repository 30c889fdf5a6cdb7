//! The paper's own Tables II to V. They were measured on other pictures and are never ranked with ours.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

const TABLES: &str = include_str!("paper_tables.json");

/// All of the paper's numbers.
#[derive(Deserialize)]
struct PaperTables {
    source: String,
    note: String,
    rows: Vec<PaperRow>,
}

#[derive(Deserialize)]
struct PaperRow {
    family: String,
    method: String,
    /// `a`, `r`, `m`: which maps are the method's own; null where it says nothing of it.
    estimated: Option<Vec<String>>,
    /// By our keys; MSE in units of 1e-3, as printed.
    values: BTreeMap<String, f64>,
}

/// The tables as the page shows them.
#[derive(Serialize)]
pub(super) struct PaperPage {
    source: String,
    note: String,
    tables: Vec<PaperTable>,
}

#[derive(Serialize)]
struct PaperTable {
    title: &'static str,
    blocks: Vec<&'static str>,
    rows: Vec<ShownRow>,
}

#[derive(Serialize)]
struct ShownRow {
    family: String,
    method: String,
    cells: Vec<String>,
}

/// Last words of keys, and digits that the paper prints.
const METRICS: [(&str, usize); 4] = [("mse", 3), ("psnr", 2), ("ssim", 4), ("lpips", 4)];

/// Number, title, and blocks with their keys.
type Words = (&'static str, &'static [(&'static str, &'static str)]);

const LAYOUT: [Words; 4] = [
    ("Table II: RGB, fitted light", &[("Input view", "rgb_fitted.input"), ("Novel views", "rgb_fitted.novel")]),
    ("Table III: albedo, input view", &[("Albedo", "albedo.input"), ("Aligned albedo", "albedo_aligned.input")]),
    ("Table IV: albedo, novel views", &[("Albedo", "albedo.novel"), ("Aligned albedo", "albedo_aligned.novel")]),
    ("Table V: aligned albedo, unobserved regions", &[("Aligned albedo", "albedo_aligned.unobserved")]),
];

/// The tables, ready to be shown.
pub(super) fn page() -> PaperPage {
    let tables: PaperTables = serde_json::from_str(TABLES).expect("a test reads the file");
    let table = |(title, blocks): Words| PaperTable {
        title,
        blocks: blocks.iter().map(|(title, _)| *title).collect(),
        rows: tables.rows.iter().filter_map(|row| shown(row, blocks)).collect(),
    };
    PaperPage { source: tables.source, note: tables.note, tables: LAYOUT.map(table).into() }
}

/// None where the paper leaves the row out of the table.
fn shown(row: &PaperRow, blocks: &[(&str, &str)]) -> Option<ShownRow> {
    let cell = |block: &str, (metric, digits): (&str, usize)| {
        row.values.get(&format!("{block}.{metric}")).map(|value| format!("{value:.digits$}"))
    };
    let cells: Vec<_> = blocks.iter().flat_map(|(_, block)| METRICS.map(|metric| cell(block, metric))).collect();
    let maps = row.estimated.as_ref().map(|maps| format!(" ({})", maps.join(", ")));
    cells.iter().any(Option::is_some).then(|| ShownRow {
        family: row.family.clone(),
        method: format!("{}{}", row.method, maps.unwrap_or_default()),
        cells: cells.into_iter().map(|cell| cell.unwrap_or_else(|| "-".to_owned())).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's Table III, first row and the row of the truth by TEXGen; Table II has more rows than the others.
    #[test]
    fn the_papers_numbers() {
        let page = page();
        let rows: Vec<usize> = page.tables.iter().map(|table| table.rows.len()).collect();
        assert_eq!(rows, [18, 10, 10, 10]);
        let first = &page.tables[1].rows[0];
        assert_eq!(
            (first.method.as_str(), first.cells[0].as_str(), first.cells[5].as_str()),
            ("PSDR-Room", "46.911", "17.59")
        );
        assert!(page.tables.iter().flat_map(|table| &table.rows).all(|row| !row.cells.contains(&"-".to_owned())));
    }
}
