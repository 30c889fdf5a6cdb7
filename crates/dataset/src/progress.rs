//! What long work reports while it runs, and the plain-text tables that it prints at its end.

use std::fmt::Write as _;

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
    /// Title and rows with words aligned left and numbers right, or `none` for a table that has only a head.
    pub fn text(&self) -> String {
        let mut text = format!("{}\n", self.title);
        if self.rows.len() <= 1 {
            text.push_str("  none\n");
            return text;
        }
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns).map(|column| self.width(column)).collect();
        for row in &self.rows {
            let cells = row.iter().zip(&widths).enumerate().map(|(at, (cell, width))| match at < self.words {
                true => format!("{cell:<width$}"),
                false => format!("{cell:>width$}"),
            });
            // Writing to a String cannot fail.
            let _ = writeln!(text, "  {}", cells.collect::<Vec<_>>().join("  ").trim_end());
        }
        text
    }

    fn width(&self, column: usize) -> usize {
        self.rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    }
}
