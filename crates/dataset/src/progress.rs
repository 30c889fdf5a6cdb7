//! What long work reports while it runs, and the plain-text tables that it prints at its end.

use std::fmt::Write as _;
use std::ops::Range;

/// One report of long work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Report<'a> {
    /// Work on a part of the whole begins, such as a scene.
    Part {
        /// What a user reads.
        name: &'a str,
        done: usize,
        total: usize,
    },
    /// Pieces of a step are finished. A step belongs to the part that began last, and to the whole work where there are
    /// no parts.
    Step {
        /// What a user reads.
        name: &'a str,
        done: usize,
        total: usize,
    },
    /// A sentence for the user, which must not be lost.
    Message(&'a str),
}

impl<'a> Report<'a> {
    pub fn part(name: &'a str, done: usize, total: usize) -> Self {
        Self::Part { name, done, total }
    }

    pub fn step(name: &'a str, done: usize, total: usize) -> Self {
        Self::Step { name, done, total }
    }
}

/// The callback by which long work reports. Several threads may call it.
pub type Progress<'a> = &'a (dyn Fn(Report<'_>) + Sync);

/// A table whose first row is its head.
pub struct Table {
    /// The line above the table.
    pub title: String,
    /// The number of columns, from the left, that hold words; all others hold numbers.
    pub words: usize,
    /// The rows, which may differ in length.
    pub rows: Vec<Vec<String>>,
}

pub fn row<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).to_vec()
}

impl Table {
    /// Title and rows with words aligned left and numbers right, or `none` for a table that has only a head. A table
    /// that is wider than a terminal of `columns` is broken into blocks of columns, and each begins with those that name
    /// the rows.
    pub fn text(&self, columns: Option<usize>) -> String {
        let mut text = columns.map_or_else(|| self.title.clone(), |columns| fitted(&self.title, columns)) + "\n";
        if self.rows.len() <= 1 {
            text.push_str("  none\n");
            return text;
        }
        let count = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let mut widths: Vec<usize> = (0..count).map(|column| self.width(column)).collect();
        let Some(columns) = columns.filter(|columns| count > 1 && wide(&widths) > *columns) else {
            self.push_block(&mut text, &(0..count).collect::<Vec<_>>(), &widths);
            return text;
        };
        // Half of the terminal at most, but for the first.
        let is_fit = |names: &usize| wide(&widths[..*names]) <= columns / 2;
        let names = (2..=self.words.min(count - 1)).rev().find(is_fit).unwrap_or(1);
        let room = columns.saturating_sub(wide(&widths[..names])).max(20);
        widths[names..].iter_mut().for_each(|width| *width = (*width).min(room - GAP));
        for (at, block) in blocks(&widths[names..], room).into_iter().enumerate() {
            text.push_str(if at > 0 { "\n" } else { "" });
            let shown: Vec<usize> = (0..names).chain(block.map(|column| names + column)).collect();
            self.push_block(&mut text, &shown, &widths);
        }
        text
    }

    /// Appends these columns of all rows; a cell that is wider than its column has several lines.
    fn push_block(&self, text: &mut String, shown: &[usize], widths: &[usize]) {
        for row in &self.rows {
            let cells = shown.iter().filter_map(|&at| Some((at, fold(row.get(at)?, widths[at]))));
            let cells: Vec<(usize, Vec<String>)> = cells.collect();
            for line in 0..cells.iter().map(|(_, lines)| lines.len()).max().unwrap_or(0) {
                let words = cells.iter().map(|(at, lines)| {
                    let (word, width) = (lines.get(line).map_or("", String::as_str), widths[*at]);
                    if *at < self.words { format!("{word:<width$}") } else { format!("{word:>width$}") }
                });
                // Writing to a String cannot fail.
                let _ = writeln!(text, "  {}", words.collect::<Vec<_>>().join("  ").trim_end());
            }
        }
    }

    fn width(&self, column: usize) -> usize {
        self.rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    }
}

/// Spaces before every column of a table.
const GAP: usize = 2;

/// The columns of a terminal that these columns of a table take.
fn wide(widths: &[usize]) -> usize {
    widths.iter().map(|width| width + GAP).sum()
}

fn fold(cell: &str, width: usize) -> Vec<String> {
    if cell.chars().count() <= width { vec![cell.to_owned()] } else { wrapped(cell.split(' '), "", "", width) }
}

/// The columns of a table, by their widths, in groups that each fit in `room` with two spaces before every column; a
/// column that is wider has a group of its own.
pub fn blocks(widths: &[usize], room: usize) -> Vec<Range<usize>> {
    let mut blocks: Vec<Range<usize>> = Vec::new();
    for at in 0..widths.len() {
        match blocks.last_mut() {
            Some(last) if wide(&widths[last.start..=at]) <= room => last.end = at + 1,
            _ => blocks.push(at..at + 1),
        }
    }
    blocks
}

/// The text with each line wrapped that is wider than a terminal of `columns`.
pub fn fitted(text: &str, columns: usize) -> String {
    let lines: Vec<String> = text.split('\n').flat_map(|line| wrapped(line.split(' '), "", "  ", columns)).collect();
    lines.join("\n")
}

/// Lines of at most this many columns, broken between words; a word that is wider has a line of its own. `first` begins
/// the first line and `next` the others.
pub fn wrapped<'a>(words: impl IntoIterator<Item = &'a str>, first: &str, next: &str, columns: usize) -> Vec<String> {
    let (mut lines, mut line, mut is_empty) = (Vec::new(), first.to_owned(), true);
    for word in words {
        if !is_empty && line.chars().count() + 1 + word.chars().count() > columns {
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

    #[test]
    fn lines_that_fit_are_left_alone_and_others_wrapped() {
        let text = "1/6  sample      2 s\nerror: 'a b' does not exist";
        assert_eq!(fitted(text, 80), text);
        assert_eq!(fitted(text, 20), "1/6  sample      2 s\nerror: 'a b' does\n  not exist");
    }

    #[test]
    fn a_table_that_is_too_wide_stands_in_blocks() {
        let rows = vec![row(["scene", "view", "error", "noise"]), row(["room", "up_left", "0.25 %", "1 %"])];
        let table = Table { title: "A table".to_owned(), words: 2, rows };
        let whole = "A table\n  scene  view      error  noise\n  room   up_left  0.25 %    1 %\n";
        assert_eq!((table.text(None).as_str(), table.text(Some(31)).as_str()), (whole, whole));
        let halves = "A table\n  scene  view      error\n  room   up_left  0.25 %\n\n  scene  noise\n  room     1 %\n";
        assert_eq!(table.text(Some(30)), halves);
        let cells = vec![row(["scene", "what"]), row(["room", "one two three four five six"])];
        let folded = Table { title: "A".to_owned(), words: 2, rows: cells }.text(Some(28));
        assert_eq!(folded, "A\n  scene  what\n  room   one two three four\n         five six\n");
    }
}
