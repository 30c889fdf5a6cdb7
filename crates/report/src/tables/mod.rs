//! Tables of several results: the paper's II to V, then ours in the same layout, for the whole dataset or by scene or
//! category.
//!
//! `layouts` lists the tables and their columns, `table` collects their numbers, fills them and marks the best, and
//! `formats` writes them.

mod formats;
mod layouts;
mod table;
#[cfg(test)]
mod tests;

pub(crate) use formats::quoted;
pub use layouts::Grouping;
pub(crate) use layouts::{CellKey, ConstancyMeans, Value};
pub(crate) use table::pooled;

use crate::error::{Mismatch, ReportError};
use crate::ranking::inexact_light;
use mateval_eval::result::ResultFile;

/// How a table is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// GitHub's Markdown; best bold, second underlined.
    Markdown,
    /// LaTeX with booktabs; best bold, second underlined.
    Latex,
    /// Comma-separated values with all digits and without marks; standard errors have columns of their own.
    Csv,
    /// Aligned text without standard errors.
    Text {
        /// The best value bold, by ANSI escape sequences.
        bold: bool,
        /// Columns of the terminal that lines must not exceed; any if absent.
        columns: Option<usize>,
    },
}

/// Puts the results side by side under one protocol. Results with different fingerprints or scenes are refused. A
/// column without values is left out. A value is shown as missing if another result has it for that scene or category,
/// and as a dash if none has or the submission does not predict that map. The result of the truth itself, the
/// `ceiling`, has the last row of each group and no mark.
pub fn tables(
    results: &[ResultFile],
    ceiling: Option<&ResultFile>,
    protocol: &str,
    grouping: Grouping,
    format: TableFormat,
) -> Result<String, ReportError> {
    let layouts = match grouping {
        Grouping::Dataset | Grouping::Scene => layouts::all(),
        Grouping::Category | Grouping::SuperCategory => layouts::pooled(),
    };
    filled(layouts, results, ceiling, protocol, grouping, format)
}

/// The most informative table: PSNR of albedo, under true light and relit, of the input view and novel ones. Otherwise
/// like [`tables()`].
pub fn headline(
    results: &[ResultFile],
    ceiling: Option<&ResultFile>,
    protocol: &str,
    format: TableFormat,
) -> Result<String, ReportError> {
    filled(vec![layouts::headline()], results, ceiling, protocol, Grouping::Dataset, format)
}

fn filled(
    mut layouts: Vec<layouts::Layout>,
    results: &[ResultFile],
    ceiling: Option<&ResultFile>,
    protocol: &str,
    grouping: Grouping,
    format: TableFormat,
) -> Result<String, ReportError> {
    check_comparable(results, ceiling, protocol)?;
    // Readers of a single table must see that its truth is withheld, and what that is worth.
    if let Some(secrecy) = results.first().and_then(|result| result.dataset.withheld) {
        layouts.iter_mut().for_each(|layout| layout.title = format!("{} ({})", layout.title, secrecy.text()));
    }
    let groups = table::groups(results, ceiling, protocol, grouping);
    let tables = layouts.iter().filter_map(|layout| table::Table::fill(layout, grouping, &groups));
    // The other formats end each table with a blank line.
    let between = if matches!(format, TableFormat::Text { .. }) { "\n" } else { "" };
    let texts: Vec<String> = tables
        .map(|table| match format {
            TableFormat::Markdown => formats::markdown(&table),
            TableFormat::Latex => formats::latex(&table),
            TableFormat::Csv => formats::csv(&table),
            TableFormat::Text { bold, columns } => formats::aligned(&table, bold, columns),
        })
        .collect();
    if texts.is_empty() {
        return Err(ReportError::NothingToShow { protocol: protocol.to_owned(), output: "a table" });
    }
    Ok(texts.join(between))
}

/// Fails with every reason for which the results cannot stand side by side.
fn check_comparable(results: &[ResultFile], ceiling: Option<&ResultFile>, protocol: &str) -> Result<(), ReportError> {
    let first = results.first().ok_or(ReportError::NoResults)?;
    let fingerprint = |result: &ResultFile| result.protocols.get(protocol).map(|scores| scores.fingerprint.clone());
    let mut mismatches = Vec::new();
    if let Some(ceiling) = ceiling
        && let Some((key, value)) = ceiling.protocols.get(protocol).and_then(inexact_light)
    {
        mismatches.push(Mismatch::Ceiling { method: ceiling.shown_method(), key: *key, value });
    }
    for result in results.iter().chain(ceiling) {
        let of_result = Mismatch::of_result(result, protocol);
        let (first_name, other) = (first.shown_method(), result.shown_method());
        if of_result.is_none() && fingerprint(first).is_some_and(|first| Some(first) != fingerprint(result)) {
            mismatches.push(Mismatch::Fingerprints { first: first_name.clone(), other: other.clone() });
        }
        if result.dataset.scenes != first.dataset.scenes {
            mismatches.push(Mismatch::Scenes { first: first_name, other });
        }
        mismatches.extend(of_result);
    }
    ReportError::refuse(mismatches)
}
