//! Tables as aligned text for a terminal of 80 columns.

use std::fmt::Write as _;

use super::table::{Column, Table};

/// Blanks between two columns.
const GAP: &str = "  ";
/// Bold on and off, as ANSI escape sequences.
const BOLD: (&str, &str) = ("\x1b[1m", "\x1b[0m");

/// A heading and the table. Standard errors are left out, since they make rows longer than a line. With `bold` the best
/// value of each column is bold.
pub(super) fn text(table: &Table<'_>, bold: bool) -> String {
    let mut text = format!("{}\n\n", table.title);
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
    // Heads stand on the line above the values, however many lines each has.
    let height = heads.iter().map(Vec::len).max().unwrap_or(0);
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
        push_line(&mut text, names.chain(values));
    }
    // The rows: names to the left, values to the right.
    for (row, row_names) in names.iter().enumerate() {
        let names = row_names.iter().zip(&name_widths).map(|(name, &wide)| padded(name, name, wide, false));
        let values = widths.iter().enumerate().map(|(at, &wide)| {
            let marked = rows[row][at].value_text(if bold { BOLD } else { ("", "") });
            padded(&plain(row, at), &marked, wide, true)
        });
        push_line(&mut text, names.chain(values));
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

/// Lines of at most this many columns, broken between words; a word that is wider has a line of its own. `first` begins
/// the first line and `next` the others.
pub fn wrapped<'a>(words: impl IntoIterator<Item = &'a str>, first: &str, next: &str, columns: usize) -> Vec<String> {
    let (mut lines, mut line, mut is_empty) = (Vec::new(), first.to_owned(), true);
    for word in words {
        if !is_empty && width(&line) + 1 + width(word) > columns {
            lines.push(std::mem::replace(&mut line, next.to_owned()));
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line.push_str(word);
        is_empty = false;
    }
    lines.push(line);
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_between_words_and_nowhere_else() {
        let lines = |words: &[&str]| wrapped(words.iter().copied(), "- ", "  ", 8);
        assert_eq!(lines(&["one", "two", "three"]), ["- one", "  two", "  three"]);
        assert_eq!(lines(&["a", "b", "c", "d"]), ["- a b c", "  d"]);
        assert_eq!(lines(&["a b c d", "e"]), ["- a b c d", "  e"]);
        assert_eq!(lines(&[]), ["- "]);
    }
}
