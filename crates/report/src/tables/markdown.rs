//! Tables as GitHub's Markdown.

use std::fmt::Write as _;

use super::table::Table;

/// A heading and the table.
pub(super) fn text(table: &Table<'_>) -> String {
    let mut heads: Vec<String> = table.group_head.iter().map(|head| (*head).to_owned()).collect();
    heads.push("Method".to_owned());
    let words = "|---".repeat(heads.len());
    heads.extend(table.columns.iter().map(super::table::Column::head));
    let mut text =
        format!("### {}\n\n| {} |\n{words}|{}\n", table.title, heads.join(" | "), "---:|".repeat(table.columns.len()));
    for group in &table.groups {
        for (method, cells) in &group.rows {
            let names = table
                .group_head
                .iter()
                .map(|_| group.name)
                .chain([method.as_str()])
                .map(|name| name.replace('|', "\\|"));
            let cells = cells.iter().map(|cell| cell.text(("**", "**"), ("<u>", "</u>"), "±"));
            // Writing to a String cannot fail.
            let _ = writeln!(text, "| {} |", names.chain(cells).collect::<Vec<_>>().join(" | "));
        }
    }
    text.push('\n');
    if !table.too_close.is_empty() {
        let _ = writeln!(text, "Closer than the noise of the truth's own pictures:\n");
        for sentence in &table.too_close {
            let _ = writeln!(text, "- {sentence}");
        }
        text.push('\n');
    }
    text
}
