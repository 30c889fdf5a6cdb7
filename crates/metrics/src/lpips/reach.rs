//! Which pixels of a layer a change reaches, and which pixels a result needs.

/// A set of the pixels of a grid, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PixelSet {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) holds: Vec<bool>,
}

/// How a layer's output pixel looks at its input: a square window, moved by the stride, with zeros around the input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    pub(crate) side: usize,
    pub(crate) stride: usize,
    pub(crate) padding: usize,
}

impl Window {
    /// The input pixels along an axis of `length` that output pixel `at` reads.
    fn along(&self, at: usize, length: usize) -> std::ops::Range<usize> {
        let start = at * self.stride;
        let inside = |at: usize| at.saturating_sub(self.padding).min(length);
        inside(start)..inside(start + self.side)
    }

    /// Width or height of the output; `None` if the window does not fit.
    pub(crate) fn output_side(&self, side: usize) -> Option<usize> {
        Some((side + 2 * self.padding).checked_sub(self.side)? / self.stride + 1)
    }
}

impl PixelSet {
    pub(crate) fn filled(width: usize, height: usize, holds: bool) -> Self {
        Self { width, height, holds: vec![holds; width * height] }
    }

    /// The pixels in the set, in order.
    pub(crate) fn pixels(&self) -> Vec<usize> {
        self.holds.iter().enumerate().filter(|(_, holds)| **holds).map(|(pixel, _)| pixel).collect()
    }

    /// The output pixels, of a grid of this size, whose window reads any of these.
    pub(crate) fn reaching(&self, window: Window, width: usize, height: usize) -> Self {
        let mut reached = Self::filled(width, height, false);
        for y in 0..height {
            let rows = window.along(y, self.height);
            // Whether each column holds any pixel of these rows.
            let mut columns = vec![false; self.width];
            for row in rows.map(|row| &self.holds[row * self.width..(row + 1) * self.width]) {
                columns.iter_mut().zip(row).for_each(|(any, holds)| *any |= holds);
            }
            for x in 0..width {
                reached.holds[y * width + x] = columns[window.along(x, self.width)].contains(&true);
            }
        }
        reached
    }

    /// The input pixels, of a grid of this size, that the windows of these read.
    pub(crate) fn read(&self, window: Window, width: usize, height: usize) -> Self {
        let mut read = Self::filled(width, height, false);
        for y in 0..self.height {
            let mut columns = vec![false; width];
            for x in (0..self.width).filter(|x| self.holds[y * self.width + x]) {
                columns[window.along(x, width)].fill(true);
            }
            for row in window.along(y, height) {
                read.holds[row * width..(row + 1) * width].iter_mut().zip(&columns).for_each(|(all, any)| *all |= any);
            }
        }
        read
    }

    /// Adds the pixels of another set of the same grid.
    pub(crate) fn add(&mut self, other: &Self) {
        self.holds.iter_mut().zip(&other.holds).for_each(|(ours, theirs)| *ours |= theirs);
    }

    /// The pixels that both hold.
    pub(crate) fn shared(mut self, other: &Self) -> Self {
        self.holds.iter_mut().zip(&other.holds).for_each(|(ours, theirs)| *ours &= theirs);
        self
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Both directions agree with the definition, pair by pair of an input and an output pixel.
        #[test]
        fn a_window_joins_what_it_reads(
            (side, stride, padding) in (1_usize..5, 1_usize..4, 0_usize..3),
            (width, height) in (5_usize..12, 5_usize..12),
            pick: usize,
        ) {
            let window = Window { side, stride, padding };
            let out = [width, height].map(|length| window.output_side(length).unwrap());
            let joined = |input: usize, output: usize| {
                let one = |input: usize, output: usize| {
                    (output * stride..output * stride + side).contains(&(input + padding))
                };
                one(input % width, output % out[0]) && one(input / width, output / out[0])
            };
            let only = |count: (usize, usize)| {
                let mut set = PixelSet::filled(count.0, count.1, false);
                let at = pick % set.holds.len();
                set.holds[at] = true;
                (at, set)
            };
            let (input, set) = only((width, height));
            let reached = set.reaching(window, out[0], out[1]);
            prop_assert!((0..out[0] * out[1]).all(|output| reached.holds[output] == joined(input, output)));
            let (output, set) = only((out[0], out[1]));
            let read = set.read(window, width, height);
            prop_assert!((0..width * height).all(|input| read.holds[input] == joined(input, output)));
        }
    }
}
