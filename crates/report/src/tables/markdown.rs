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
            let names = table.group_head.iter().map(|_| group.name).chain([method.as_str()]).map(plain_text);
            let cells = cells.iter().map(|cell| cell.text(("**", "**"), ("<u>", "</u>"), "±"));
            // Writing to a String cannot fail.
            let _ = writeln!(text, "| {} |", names.chain(cells).collect::<Vec<_>>().join(" | "));
        }
    }
    text.push('\n');
    text
}

/// Markdown that shows the text as it is, in one line: names of methods are untrusted, and could otherwise end a cell,
/// link, or hold HTML. An underscore within a word stays, since it means nothing there.
fn plain_text(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let is_word = |at: Option<usize>| at.and_then(|at| chars.get(at)).is_some_and(|c| c.is_alphanumeric());
    let mut escaped = String::new();
    for (at, &c) in chars.iter().enumerate() {
        match c {
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '&' => escaped.push_str("&amp;"),
            '_' if is_word(at.checked_sub(1)) && is_word(Some(at + 1)) => escaped.push('_'),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '~' => escaped.extend(['\\', c]),
            _ if c.is_control() => escaped.push(' '),
            _ => escaped.push(c),
        }
    }
    escaped
}
