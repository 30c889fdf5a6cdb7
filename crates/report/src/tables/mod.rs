//! Tables of several results: the paper's II to V, then ours in the same layout; whole, or by scene or category.
//!
//! `layouts` says which tables there are, `rows` where their numbers come from, `table` sets them and marks the best,
//! and a file for each format writes them.

pub(crate) mod csv;
mod grouping;
mod latex;
mod layouts;
mod markdown;
pub(crate) mod pooled;
mod rows;
mod table;
#[cfg(test)]
mod tests;
pub(crate) mod value;

pub use grouping::Grouping;

use crate::error::ReportError;
use mateval_eval::result::{RESULT_FORMAT, ResultFile};

/// How a table is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// GitHub's Markdown; best bold, second underlined.
    Markdown,
    /// LaTeX with booktabs; best bold, second underlined.
    Latex,
    /// Comma-separated, all digits, no marks; standard errors in columns of their own.
    Csv,
}

/// Sets the results side by side under one protocol. Results of different fingerprints, or of different scenes, are
/// refused. A column that no result has is left out; a value that some result lacks is shown as missing, and as a dash where
/// no result has it of that scene or category.
pub fn tables(
    results: &[ResultFile],
    protocol: &str,
    grouping: Grouping,
    format: TableFormat,
) -> Result<String, ReportError> {
    check_comparable(results, protocol)?;
    let layouts = match grouping {
        Grouping::Dataset | Grouping::Scene => layouts::all(),
        Grouping::Category | Grouping::SuperCategory => layouts::pooled(),
    };
    let groups = rows::groups(results, protocol, grouping);
    let tables = layouts.iter().filter_map(|layout| table::Table::fill(layout, grouping, &groups));
    let text: String = tables
        .map(|table| match format {
            TableFormat::Markdown => markdown::text(&table),
            TableFormat::Latex => latex::text(&table),
            TableFormat::Csv => csv::text(&table),
        })
        .collect();
    if text.is_empty() {
        let what = format!("the results hold nothing under protocol '{protocol}' that a table shows");
        return Err(ReportError::Invalid(what));
    }
    Ok(text)
}

fn check_comparable(results: &[ResultFile], protocol: &str) -> Result<(), ReportError> {
    let Some(first) = results.first() else {
        return Err(ReportError::Invalid("no result to make a table of".to_owned()));
    };
    let mut faults = Vec::new();
    for result in results {
        if result.format != RESULT_FORMAT {
            faults.push(format!(
                "'{}' is of format '{}'; this version reads '{RESULT_FORMAT}'",
                result.method, result.format
            ));
        }
        let Some(scores) = result.protocols.get(protocol) else {
            faults.push(format!(
                "'{}' has no scores under protocol '{protocol}'; score it with --protocol {protocol}",
                result.method
            ));
            continue;
        };
        let expected = first.protocols.get(protocol).map(|scores| &scores.fingerprint);
        if expected.is_some_and(|expected| *expected != scores.fingerprint) {
            faults.push(format!(
                "'{}' and '{}' have different fingerprints: dataset, protocol, scorer or LPIPS weights are not the same; \
                 score both again with one",
                first.method, result.method
            ));
        }
        if result.dataset.scenes != first.dataset.scenes {
            faults.push(format!("'{}' and '{}' were scored on different scenes", first.method, result.method));
        }
    }
    if faults.is_empty() { Ok(()) } else { Err(ReportError::Invalid(faults.join("; "))) }
}
