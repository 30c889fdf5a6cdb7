//! Tables as Markdown, LaTeX, comma-separated values and aligned text. Names of methods are untrusted in each of them.

use std::fmt::Write as _;

use mateval_dataset::progress::{blocks, fitted};
use mateval_eval::metric::Better;

use super::table::{Cell, Column, Table};

const GAP: &str = "  ";
/// Bold on and off, as ANSI escape sequences.
const BOLD: (&str, &str) = ("\x1b[1m", "\x1b[0m");

/// GitHub's Markdown: a heading and the table.
pub(super) fn markdown(table: &Table<'_>) -> String {
    let mut heads: Vec<String> = table.group_head.iter().map(|head| (*head).to_owned()).collect();
    heads.push("Method".to_owned());
    let words = "|---".repeat(heads.len());
    heads.extend(table.columns.iter().map(Column::head));
    let mut text =
        format!("### {}\n\n| {} |\n{words}|{}\n", table.title, heads.join(" | "), "---:|".repeat(table.columns.len()));
    for group in &table.groups {
        for (method, cells) in &group.rows {
            let names = table.group_head.iter().map(|_| group.name).chain([method.as_str()]).map(markdown_text);
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
fn markdown_text(text: &str) -> String {
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

/// LaTeX with booktabs: a comment with the title, and the table.
pub(super) fn latex(table: &Table<'_>) -> String {
    let words = 1 + usize::from(table.group_head.is_some());
    let layout = "l".repeat(words) + &"r".repeat(table.columns.len());
    let mut text = format!("% {}\n\\begin{{tabular}}{{{layout}}}\n\\toprule\n", table.title);
    let blocks = table.blocks.iter().map(|(title, columns)| format!("\\multicolumn{{{columns}}}{{c}}{{{title}}}"));
    let blocks: Vec<String> = std::iter::repeat_n(String::new(), words).chain(blocks).collect();
    // Writing to a String cannot fail, here and below.
    let _ = writeln!(text, "{} \\\\", blocks.join(" & ").trim_start());
    let heads = table.columns.iter().map(|column| {
        let arrow = match column.key.quantity.better() {
            Some(Better::Lower) => " $\\downarrow$",
            Some(Better::Higher) => " $\\uparrow$",
            None => "",
        };
        format!("{}{arrow}", column.key.quantity.style().title.replace("1e-3", "$10^{-3}$"))
    });
    let names = table.group_head.into_iter().chain(["Method"]).map(str::to_owned);
    let _ = writeln!(text, "{} \\\\", names.chain(heads).collect::<Vec<_>>().join(" & "));
    for group in &table.groups {
        text.push_str("\\midrule\n");
        for (method, cells) in &group.rows {
            let names = table.group_head.iter().map(|_| group.name).chain([method.as_str()]).map(latex_text);
            let cells = cells.iter().map(|cell| cell.text(("\\textbf{", "}"), ("\\underline{", "}"), "$\\pm$"));
            let _ = writeln!(text, "{} \\\\", names.chain(cells).collect::<Vec<_>>().join(" & "));
        }
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n\n");
    text
}

/// LaTeX that shows the text as it is, in one line: names of methods are untrusted.
fn latex_text(text: &str) -> String {
    text.chars()
        .flat_map(|c| match c {
            '\\' => "\\textbackslash{}".chars().collect::<Vec<_>>(),
            '~' => "\\textasciitilde{}".chars().collect(),
            '^' => "\\textasciicircum{}".chars().collect(),
            '<' => "\\textless{}".chars().collect(),
            '>' => "\\textgreater{}".chars().collect(),
            '|' => "\\textbar{}".chars().collect(),
            // An empty line would end the paragraph inside the cell.
            _ if c.is_control() => vec![' '],
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => vec!['\\', c],
            _ => vec![c],
        })
        .collect()
}

/// Comma-separated values, with all digits. The table's title is the head of the column of methods. Missing values are
/// empty.
pub(super) fn csv(table: &Table<'_>) -> String {
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

/// A cell of text in quotation marks. A single quote goes before text that a spreadsheet would take for a formula
/// (OWASP, "CSV Injection"): names of methods are untrusted. Numbers have no such quote, as they may begin with a
/// minus.
pub(crate) fn quoted(text: &str) -> String {
    let guard = if text.starts_with(['=', '+', '-', '@', '\t', '\r', '\n']) { "'" } else { "" };
    format!("\"{guard}{}\"", text.replace('"', "\"\""))
}

/// Aligned text: a heading and the table. Standard errors are left out, since they make rows longer than a line. With
/// `bold` the best value of each column is bold. Of a table that is wider than `columns`, the columns of values stand in
/// several blocks below each other.
pub(super) fn aligned(table: &Table<'_>, bold: bool, columns: Option<usize>) -> String {
    let title = columns.map_or_else(|| table.title.to_owned(), |columns| fitted(table.title, columns));
    let mut text = format!("{title}\n\n");
    let names: Vec<Vec<String>> = table
        .groups
        .iter()
        .flat_map(|group| {
            group.rows.iter().map(|(method, _)| match table.group_head {
                Some(_) => vec![shown(group.name), shown(method)],
                None => vec![shown(method)],
            })
        })
        .collect();
    // Every column is as wide as its longest cell.
    let name_heads: Vec<&str> = table.group_head.into_iter().chain(["Method"]).collect();
    let name_widths: Vec<usize> = (0..name_heads.len())
        .map(|at| names.iter().map(|row| width(&row[at])).chain([width(name_heads[at])]).max().unwrap_or(0))
        .collect();
    let rows: Vec<_> = table.groups.iter().flat_map(|group| group.rows.iter().map(|(_, cells)| cells)).collect();
    let plain = |row: usize, column: usize| rows[row][column].value_text(("", ""));
    let heads: Vec<Vec<String>> = table.columns.iter().map(head_lines).collect();
    let widths: Vec<usize> = (0..table.columns.len())
        .map(|at| {
            let cells = (0..rows.len()).map(|row| width(&plain(row, at)));
            cells.chain(heads[at].iter().map(|line| width(line))).max().unwrap_or(0)
        })
        .collect();
    let of_names = name_widths.iter().sum::<usize>() + GAP.len() * (name_widths.len() - 1);
    let all = 0..widths.len();
    let blocks = columns.map_or_else(|| vec![all], |columns| blocks(&widths, columns.saturating_sub(of_names)));
    // Heads stand on the line above the values, however many lines each has.
    let height = heads.iter().map(Vec::len).max().unwrap_or(0);
    for (at, block) in blocks.into_iter().enumerate() {
        text.push_str(if at > 0 { "\n" } else { "" });
        for line in 0..height {
            let names = name_heads.iter().zip(&name_widths).map(|(head, width)| {
                let head = if line + 1 == height { head } else { "" };
                format!("{head:<width$}")
            });
            let values = heads.iter().zip(&widths).map(|(head, width)| {
                let from_bottom = height - line;
                let word = head.len().checked_sub(from_bottom).map_or("", |at| head[at].as_str());
                format!("{word:>width$}")
            });
            push_line(&mut text, names.chain(values.skip(block.start).take(block.len())));
        }
        // The rows: names to the left, values to the right.
        for (row, row_names) in names.iter().enumerate() {
            let names = row_names.iter().zip(&name_widths).map(|(name, &wide)| padded(name, name, wide, false));
            let values = block.clone().map(|at| {
                let marked = rows[row][at].value_text(if bold { BOLD } else { ("", "") });
                padded(&plain(row, at), &marked, widths[at], true)
            });
            push_line(&mut text, names.chain(values));
        }
    }
    text
}

/// The words of a column's head, one a line, so that six columns fit beside each other.
fn head_lines(column: &Column) -> Vec<String> {
    let head = column.head();
    let (words, arrow) = head.rsplit_once(' ').filter(|(_, last)| ["↑", "↓"].contains(last)).unwrap_or((&head, ""));
    let mut lines: Vec<String> = words.split(' ').map(|word| word.trim_end_matches(',').to_owned()).collect();
    if let Some(last) = lines.last_mut().filter(|_| !arrow.is_empty()) {
        let _ = write!(last, " {arrow}");
    }
    lines
}

/// Names of methods are untrusted: a control character could move the cursor.
fn shown(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

fn width(text: &str) -> usize {
    text.chars().count()
}

/// `marked`, which shows the letters of `plain`, filled up to `wide` columns.
fn padded(plain: &str, marked: &str, wide: usize, right: bool) -> String {
    let fill = " ".repeat(wide.saturating_sub(width(plain)));
    if right { format!("{fill}{marked}") } else { format!("{marked}{fill}") }
}

fn push_line(text: &mut String, cells: impl Iterator<Item = String>) {
    text.push_str(cells.collect::<Vec<_>>().join(GAP).trim_end());
    text.push('\n');
}
