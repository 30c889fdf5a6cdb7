//! A set of texels of a map, one bit each: the largest map takes 2 MiB.

/// A set of texels, by their numbers row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TexelSet {
    width: usize,
    height: usize,
    words: Vec<u64>,
}

impl TexelSet {
    /// No texel of a map of this size.
    pub(crate) fn none(width: usize, height: usize) -> Self {
        Self { width, height, words: vec![0; (width * height).div_ceil(64)] }
    }

    /// Every texel of a map of this size.
    pub(crate) fn all(width: usize, height: usize) -> Self {
        let mut all = Self::none(width, height);
        all.add_run(0..width * height);
        all
    }

    /// Texels in a row of the map.
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// Rows of the map.
    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// How many texels it holds.
    pub(crate) fn count(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Whether it holds texel `at`.
    pub(crate) fn holds(&self, at: usize) -> bool {
        self.words[at / 64] >> (at % 64) & 1 == 1
    }

    /// Adds consecutive texels, a word at a time.
    pub(crate) fn add_run(&mut self, run: std::ops::Range<usize>) {
        let mut at = run.start;
        while at < run.end {
            let count = (64 - at % 64).min(run.end - at);
            self.words[at / 64] |= (u64::MAX >> (64 - count)) << (at % 64);
            at += count;
        }
    }

    /// Removes texel `at`.
    pub(crate) fn remove(&mut self, at: usize) {
        self.words[at / 64] &= !(1 << (at % 64));
    }

    /// Its texels in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.words.iter().enumerate().flat_map(|(word, bits)| {
            let after = |bits: &u64| Some(bits & bits.wrapping_sub(1)).filter(|bits| *bits != 0);
            let states = std::iter::successors(Some(*bits).filter(|bits| *bits != 0), after);
            states.map(move |bits| 64 * word + bits.trailing_zeros() as usize)
        })
    }

    /// The up to eight texels of the map around texel `at`, in order.
    pub(crate) fn neighbours(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.height);
        let (x, y) = (at % width, at / width);
        let around = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
        let rows = around(y, height);
        rows.flat_map(move |y| around(x, width).map(move |x| y * width + x)).filter(move |other| *other != at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_the_texels_that_were_added() {
        for run in [0..0, 0..1, 63..64, 63..65, 5..200, 128..192, 0..221, 220..221] {
            let mut set = TexelSet::none(17, 13);
            set.add_run(run.clone());
            assert_eq!(set.iter().collect::<Vec<_>>(), run.clone().collect::<Vec<_>>());
            assert_eq!(set.count(), run.len());
            assert!((0..221).all(|at| set.holds(at) == run.contains(&at)), "{run:?}");
        }
        let mut all = TexelSet::all(17, 13);
        all.remove(64);
        assert!(!all.holds(64) && all.count() == 220 && all.iter().all(|at| at != 64));
    }

    #[test]
    fn neighbours_end_at_the_border() {
        let set = TexelSet::none(4, 3);
        let around = |at: usize| set.neighbours(at).collect::<Vec<_>>();
        assert_eq!(around(0), [1, 4, 5]);
        assert_eq!(around(5), [0, 1, 2, 4, 6, 8, 9, 10]);
        assert_eq!(around(11), [6, 7, 10]);
        assert_eq!(TexelSet::none(1, 1).neighbours(0).count(), 0);
    }
}
