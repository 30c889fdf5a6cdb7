//! Letters and arrows of five by seven dots. They show which way up a texture is and whether it is mirrored.

/// Dots from the left edge of a letter to that of the next.
const ADVANCE: usize = 6;
/// Dots from the top of a line to that of the next.
const LINE: usize = 9;

/// Characters and their rows from the top. Bit 4 of a row is the leftmost dot.
const GLYPHS: [(char, [u8; 7]); 29] = [
    ('A', [0x0e, 0x11, 0x11, 0x1f, 0x11, 0x11, 0x11]),
    ('B', [0x1e, 0x11, 0x11, 0x1e, 0x11, 0x11, 0x1e]),
    ('C', [0x0e, 0x11, 0x10, 0x10, 0x10, 0x11, 0x0e]),
    ('D', [0x1e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x1e]),
    ('E', [0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x1f]),
    ('F', [0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x10]),
    ('G', [0x0e, 0x11, 0x10, 0x17, 0x11, 0x11, 0x0f]),
    ('H', [0x11, 0x11, 0x11, 0x1f, 0x11, 0x11, 0x11]),
    ('I', [0x0e, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0e]),
    ('J', [0x07, 0x02, 0x02, 0x02, 0x02, 0x12, 0x0c]),
    ('K', [0x11, 0x12, 0x14, 0x18, 0x14, 0x12, 0x11]),
    ('L', [0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x1f]),
    ('M', [0x11, 0x1b, 0x15, 0x15, 0x11, 0x11, 0x11]),
    ('N', [0x11, 0x11, 0x19, 0x15, 0x13, 0x11, 0x11]),
    ('O', [0x0e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e]),
    ('P', [0x1e, 0x11, 0x11, 0x1e, 0x10, 0x10, 0x10]),
    ('Q', [0x0e, 0x11, 0x11, 0x11, 0x15, 0x12, 0x0d]),
    ('R', [0x1e, 0x11, 0x11, 0x1e, 0x14, 0x12, 0x11]),
    ('S', [0x0f, 0x10, 0x10, 0x0e, 0x01, 0x01, 0x1e]),
    ('T', [0x1f, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04]),
    ('U', [0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e]),
    ('V', [0x11, 0x11, 0x11, 0x11, 0x11, 0x0a, 0x04]),
    ('W', [0x11, 0x11, 0x11, 0x15, 0x15, 0x1b, 0x11]),
    ('X', [0x11, 0x11, 0x0a, 0x04, 0x0a, 0x11, 0x11]),
    ('Y', [0x11, 0x11, 0x0a, 0x04, 0x04, 0x04, 0x04]),
    ('Z', [0x1f, 0x01, 0x02, 0x04, 0x08, 0x10, 0x1f]),
    ('^', [0x04, 0x0e, 0x15, 0x04, 0x04, 0x04, 0x04]),
    ('>', [0x00, 0x04, 0x02, 0x1f, 0x02, 0x04, 0x00]),
    ('_', [0x04, 0x04, 0x04, 0x04, 0x15, 0x0e, 0x04]),
];

/// Whether the dot at `column`, `row` of a line of text is inked. `^`, `>` and `_` are arrows up, right and down. A
/// character without a glyph is blank.
fn is_inked(line: &str, column: usize, row: usize) -> bool {
    let glyph = line.chars().nth(column / ADVANCE).and_then(|letter| GLYPHS.iter().find(|(known, _)| *known == letter));
    let (dot, rows) = (column % ADVANCE, 7);
    glyph.is_some_and(|(_, bits)| dot < 5 && row < rows && bits[row] & (0x10 >> dot) != 0)
}

/// Text in a picture. Lengths are fractions of the picture, measured from its upper left corner.
#[derive(Clone, Copy, Debug)]
pub struct Lettering {
    /// Lines from the top down.
    pub lines: &'static [&'static str],
    /// Upper left corner of the first letter.
    pub at: [f64; 2],
    /// Width and height of a dot.
    pub dot: [f64; 2],
}

impl Lettering {
    /// Text in the middle of the rectangle from `low` to `high`, as large as fits with square dots. `aspect` is the width
    /// of the surface that shows the picture divided by its height.
    pub fn fitted(lines: &'static [&'static str], low: [f64; 2], high: [f64; 2], aspect: f64) -> Self {
        let longest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(1);
        let columns = (longest * ADVANCE - 1) as f64;
        let rows = (lines.len() * LINE - 2) as f64;
        let size = ((high[0] - low[0]) / columns).min((high[1] - low[1]) / aspect / rows);
        let dot = [size, size * aspect];
        let left = (low[0] + high[0] - columns * dot[0]) / 2.0;
        let top = (low[1] + high[1] - rows * dot[1]) / 2.0;
        Self { lines, at: [left, top], dot }
    }

    /// Whether a point of the picture is inked.
    pub fn covers(&self, u: f64, v: f64) -> bool {
        let (x, y) = ((u - self.at[0]) / self.dot[0], (v - self.at[1]) / self.dot[1]);
        if x < 0.0 || y < 0.0 {
            return false;
        }
        let (column, row) = (x as usize, y as usize);
        self.lines.get(row / LINE).is_some_and(|line| is_inked(line, column, row % LINE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_fill_their_rectangle() {
        let text = Lettering::fitted(&["L"], [0.0, 0.0], [1.0, 1.0], 5.0 / 7.0);
        // An L has a stroke down the left, a foot to the right, and nothing above the foot.
        assert!(text.covers(0.1, 0.1) && text.covers(0.9, 0.95) && !text.covers(0.9, 0.1));
        assert!(!text.covers(-0.1, 0.1) && !text.covers(0.1, 1.1));
    }

    /// A mirrored text differs from the text. The twin is a letter that is its own mirror image.
    #[test]
    fn asymmetric_words_change_under_a_mirror() {
        let differs = |lines: &'static [&'static str]| {
            let text = Lettering::fitted(lines, [0.0; 2], [1.0; 2], 1.0);
            (0..900).any(|i| {
                let (u, v) = (f64::from(i % 30) / 30.0 + 0.017, f64::from(i / 30) / 30.0 + 0.017);
                text.covers(u, v) != text.covers(1.0 - u, v)
            })
        };
        assert!([&["MATEVAL"], &["N"], &["BED ^"], &["X>"]].into_iter().all(|lines| differs(lines)));
        assert!(!differs(&["H"]));
    }
}
