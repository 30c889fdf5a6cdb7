//! The rows of the fit: averages over squares of pixels.
//!
//! Pixels whose photo is clipped are averaged apart from the others of their square: there the photo states only the least
//! radiance, the one at which it clips.

use mateval_image::{LinearRgb, Mask, Picture};

use super::target::FitTarget;
use crate::rules::FitRules;

/// Averages over squares of [`FitRules::pool`] pixels, by channel. Pixels outside the mask or the picture count as black,
/// so that every pixel has the same weight.
pub fn pooled(rules: &FitRules, picture: &Picture<LinearRgb>, mask: Option<&Mask>) -> [Vec<f64>; 3] {
    let counts = |x, y| mask.is_none_or(|mask| mask.get(x, y));
    [0, 1, 2].map(|channel| averages(rules, picture, channel, counts))
}

/// The squares of a photo in one channel: first those of pixels that are not clipped, then those of pixels that are. Squares
/// that no pixel counts in are left out.
pub(super) struct Rows<'a> {
    rules: &'a FitRules,
    target: &'a FitTarget<'a>,
    channel: usize,
    /// The squares with pixels that are not clipped, and those with pixels that are.
    squares: [Vec<usize>; 2],
}

impl<'a> Rows<'a> {
    pub(super) fn new(rules: &'a FitRules, target: &'a FitTarget<'a>, channel: usize) -> Self {
        let ones = target.photo.map(|_| LinearRgb([1.0; 3]));
        let mut rows = Self { rules, target, channel, squares: Default::default() };
        let lit = |clipped| {
            let shares = averages(rules, &ones, channel, |x, y| rows.is_counted(x, y, clipped)).into_iter().enumerate();
            shares.filter(|(_, share)| *share > 0.0).map(|(square, _)| square).collect()
        };
        rows.squares = [lit(false), lit(true)];
        rows
    }

    /// The least radiance of a clipped pixel.
    fn limit(&self) -> f64 {
        1.0 / self.target.exposure
    }

    fn is_counted(&self, x: usize, y: usize, clipped: bool) -> bool {
        let is_clipped = f64::from(self.target.photo.get(x, y).0[self.channel]) >= self.limit();
        self.target.mask.is_none_or(|mask| mask.get(x, y)) && is_clipped == clipped
    }

    /// The averages of a picture.
    pub(super) fn of(&self, picture: &Picture<LinearRgb>) -> Vec<f64> {
        let part = |clipped: bool| {
            let values = averages(self.rules, picture, self.channel, |x, y| self.is_counted(x, y, clipped));
            self.squares[usize::from(clipped)].iter().map(move |&square| values[square])
        };
        part(false).chain(part(true)).collect()
    }

    /// The averages of the photo, where clipped pixels have the radiance at which they clip.
    pub(super) fn of_photo(&self) -> Vec<f64> {
        let limit = self.limit() as f32;
        self.of(&self.target.photo.map(|pixel| LinearRgb(pixel.0.map(|v| v.min(limit)))))
    }

    /// For each row, whether its pixels are clipped.
    pub(super) fn at_least(&self) -> Vec<bool> {
        let [exact, clipped] = &self.squares;
        exact.iter().map(|_| false).chain(clipped.iter().map(|_| true)).collect()
    }
}

/// Averages of one channel over squares of pixels; pixels that do not count are black.
fn averages(
    rules: &FitRules,
    picture: &Picture<LinearRgb>,
    channel: usize,
    counts: impl Fn(usize, usize) -> bool,
) -> Vec<f64> {
    let pool = rules.pool.max(1) as usize;
    let (columns, rows) = (picture.width().div_ceil(pool), picture.height().div_ceil(pool));
    let mut sums = vec![0.0; columns * rows];
    for y in 0..picture.height() {
        for x in (0..picture.width()).filter(|&x| counts(x, y)) {
            let value = f64::from(picture.get(x, y).0[channel]);
            sums[y / pool * columns + x / pool] += value / (pool * pool) as f64;
        }
    }
    sums
}
