//! Tables as comma-separated values, with all digits.

use super::table::{Cell, Column, Table};

/// The table; its title is the head of the column of methods. Missing values are empty.
pub(super) fn text(table: &Table<'_>) -> String {
    let names = table.group_head.into_iter().chain([table.title]).map(quoted);
    let heads = table.columns.iter().flat_map(|column| {
        let head = column.head();
        let error = column
            .has_errors
            .then(|| quoted(&format!("{} {} standard error", column.block, column.key.quantity.style().title)));
        [quoted(&head)].into_iter().chain(error)
    });
    let mut lines = vec![names.chain(heads).collect::<Vec<_>>().join(",")];
    for group in &table.groups {
        for (method, cells) in &group.rows {
            let names = table.group_head.iter().map(|_| group.name).chain([method.as_str()]).map(quoted);
            let cells = table.columns.iter().zip(cells).flat_map(|(column, cell)| numbers(column, cell));
            lines.push(names.chain(cells).collect::<Vec<_>>().join(","));
        }
    }
    lines.join("\n") + "\n\n"
}

fn numbers(column: &Column, cell: &Cell) -> impl Iterator<Item = String> {
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let error = column.has_errors.then(|| number(cell.value.and_then(|value| value.standard_error)));
    [number(cell.value.map(|value| value.value))].into_iter().chain(error)
}

/// A cell of text in quotation marks. A single quote goes before text that a spreadsheet would take for a formula (OWASP,
/// "CSV Injection"): names of methods are untrusted. Numbers have no such quote, as they may begin with a minus.
pub(crate) fn quoted(text: &str) -> String {
    let guard = if text.starts_with(['=', '+', '-', '@', '\t', '\r', '\n']) { "'" } else { "" };
    format!("\"{guard}{}\"", text.replace('"', "\"\""))
}
