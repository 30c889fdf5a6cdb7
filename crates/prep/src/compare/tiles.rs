//! The statistics of comparing two renderers' pictures tile by tile: how far means differ, and how far noise alone lets
//! them differ.
//!
//! Each renderer gives two halves of a picture. The mean of a pixel's halves a and b has a variance whose expected value
//! is that of ((a - b) / 2)², whatever the distribution. The variances of a tile's pixels and of both renderers add up.

use std::ops::Range;

use mateval_image::{LinearRgb, Picture};

use super::file::{BOUNDS, FALSE_ALARM};

/// Pixels along a tile's side.
pub(super) const TILE: usize = 16;

/// Two independent estimates of the same picture, of the same size.
#[derive(Clone, Debug)]
pub(super) struct Halves {
    pub(super) a: Picture<LinearRgb>,
    pub(super) b: Picture<LinearRgb>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    pub(super) columns: Range<usize>,
    pub(super) rows: Range<usize>,
}

/// The difference of two pictures' means over some pixels, by channel: theirs minus ours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Difference {
    /// The difference of the means.
    pub(super) mean: [f64; 3],
    pub(super) error: [f64; 3],
}

/// Divides a picture into tiles of 16x16 pixels. A remainder of at least 8 pixels at the right or lower edge is a tile
/// of its own. A smaller one belongs to its neighbour, since the variance of a few pixels is not known well enough for
/// a test.
pub(super) fn tiles(width: usize, height: usize) -> Vec<Tile> {
    let columns = cuts(width);
    let rows = cuts(height);
    rows.iter()
        .flat_map(|rows| columns.iter().map(|columns| Tile { columns: columns.clone(), rows: rows.clone() }))
        .collect()
}

fn cuts(length: usize) -> Vec<Range<usize>> {
    let count = ((length + TILE / 2) / TILE).max(1);
    (0..count).map(|k| k * TILE..if k + 1 == count { length } else { (k + 1) * TILE }).collect()
}

impl Tile {
    /// Column and row of each of its pixels, row by row.
    pub(super) fn pixels(&self) -> impl Iterator<Item = (usize, usize)> {
        self.rows.clone().flat_map(|y| self.columns.clone().map(move |x| (x, y)))
    }
}

impl Halves {
    /// The mean of each channel over these pixels; 0 where there are none.
    pub(super) fn means(&self, pixels: &[(usize, usize)]) -> [f64; 3] {
        let mut sum = [0.0_f64; 3];
        for &(x, y) in pixels {
            let [a, b] = [&self.a, &self.b].map(|half| half.get(x, y).0);
            for c in 0..3 {
                sum[c] += (f64::from(a[c]) + f64::from(b[c])) / 2.0;
            }
        }
        sum.map(|sum| sum / pixels.len().max(1) as f64)
    }

    /// The variance of each channel's mean over these pixels.
    pub(super) fn variance(&self, pixels: impl Iterator<Item = (usize, usize)>) -> [f64; 3] {
        let (mut sum, mut count) = ([0.0_f64; 3], 0_usize);
        for (x, y) in pixels {
            let [a, b] = [&self.a, &self.b].map(|half| half.get(x, y).0.map(f64::from));
            for c in 0..3 {
                sum[c] += ((a[c] - b[c]) / 2.0).powi(2);
            }
            count += 1;
        }
        sum.map(|sum| sum / (count.max(1) as f64).powi(2))
    }

    /// The mean of the two halves.
    pub(super) fn mean(&self) -> Picture<LinearRgb> {
        let pixel = |(a, b): (&LinearRgb, &LinearRgb)| LinearRgb([0, 1, 2].map(|c| (a.0[c] + b.0[c]) / 2.0));
        let pixels = self.a.pixels().iter().zip(self.b.pixels()).map(pixel).collect();
        Picture::new(self.a.width(), self.a.height(), pixels).expect("both halves are of one size")
    }
}

/// The difference of the two pictures' means over these pixels.
pub(super) fn difference(
    ours: &Halves,
    theirs: &Halves,
    pixels: impl IntoIterator<Item = (usize, usize)>,
) -> Difference {
    let (mut sum, mut variance, mut count) = ([0.0_f64; 3], [0.0_f64; 3], 0_usize);
    for (x, y) in pixels {
        let [a, b, p, q] = [&ours.a, &ours.b, &theirs.a, &theirs.b].map(|half| half.get(x, y).0.map(f64::from));
        for c in 0..3 {
            sum[c] += (p[c] + q[c] - a[c] - b[c]) / 2.0;
            variance[c] += ((a[c] - b[c]) / 2.0).powi(2) + ((p[c] - q[c]) / 2.0).powi(2);
        }
        count += 1;
    }
    let count = count.max(1) as f64;
    Difference { mean: sum.map(|sum| sum / count), error: variance.map(|variance| variance.sqrt() / count) }
}

impl Difference {
    /// The difference in each channel divided by what is allowed there: the bound times `scale`, plus three standard
    /// errors. Above 1 the channel is over the bound; a channel that is black in both pictures gives 0.
    pub(super) fn excess(&self, bound: f64, scale: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|c| match self.mean[c].abs() {
            0.0 => 0.0,
            off => off / (bound * scale[c] + BOUNDS.standard_errors * self.error[c]),
        })
    }

    /// The channel with the largest [`Self::excess`].
    pub(super) fn worst_channel(&self, bound: f64, scale: [f64; 3]) -> usize {
        let excess = self.excess(bound, scale);
        (1..3).fold(0, |worst, c| if excess[c] > excess[worst] { c } else { worst })
    }

    /// Whether any channel is over the bound.
    pub(super) fn is_over(&self, bound: f64, scale: [f64; 3]) -> bool {
        self.excess(bound, scale).iter().any(|excess| *excess > 1.0)
    }

    /// Three standard errors divided by the bound, in the channel with the largest quotient; absent if `scale` is 0
    /// in every channel.
    pub(super) fn noise(&self, bound: f64, scale: [f64; 3]) -> Option<f64> {
        let of = |c: usize| (scale[c] > 0.0).then(|| BOUNDS.standard_errors * self.error[c] / (bound * scale[c]));
        (0..3).filter_map(of).max_by(f64::total_cmp)
    }

    /// An upper limit of the probability that noise alone puts it over the bound where the expected values are equal:
    /// two tails of a normal distribution in each channel.
    fn false_alarm(&self, bound: f64, scale: [f64; 3]) -> f64 {
        let tails = |c: usize| {
            let errors = BOUNDS.standard_errors + bound * scale[c] / self.error[c];
            if self.error[c] > 0.0 { libm::erfc(errors / std::f64::consts::SQRT_2) } else { 0.0 }
        };
        (0..3).map(tails).sum::<f64>().min(1.0)
    }
}

/// How many of the tiles may be over the bound, and how many noise alone puts there on average. Allowed are 1 % of the
/// tiles, plus the number that noise alone exceeds at most once in 1000 pictures. The latter is 0 where the noise is
/// small compared with the bound. Where it is not, three channels at three standard errors would use up the 1 % for
/// noise.
pub(super) fn allowance(tiles: &[Difference], bound: f64, scale: [f64; 3]) -> (usize, f64) {
    let expected = tiles.iter().map(|tile| tile.false_alarm(bound, scale)).sum();
    ((BOUNDS.tile_share_over * tiles.len() as f64) as usize + poisson_quantile(expected), expected)
}

/// The smallest k that a Poisson variable of this mean exceeds with a probability of at most [`FALSE_ALARM`].
fn poisson_quantile(mean: f64) -> usize {
    // For a large mean the distribution is nearly normal, and 3.3 standard deviations cover its skewness as well.
    if mean > 100.0 {
        return (mean + 3.3 * mean.sqrt()).ceil() as usize;
    }
    let mut term = libm::exp(-mean);
    let mut below = term;
    let mut k = 0;
    while 1.0 - below > FALSE_ALARM {
        k += 1;
        term *= mean / k as f64;
        below += term;
    }
    k
}

/// The middle value, or the mean of the two middle values; none of an empty list.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[middle]),
        _ => Some((values[middle - 1] + values[middle]) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_divided_without_gaps_and_slivers() {
        for (width, height, expected) in
            [(96, 72, 30), (480, 270, 510), (103, 71, 24), (104, 72, 35), (5, 3, 1), (1, 40, 3)]
        {
            let tiles = tiles(width, height);
            assert_eq!(tiles.len(), expected, "{width}x{height}");
            let mut covered = vec![0; width * height];
            for tile in &tiles {
                assert!(tile.columns.len() >= width.min(8) && tile.rows.len() >= height.min(8), "{tile:?}");
                for (x, y) in tile.pixels() {
                    covered[y * width + x] += 1;
                }
            }
            assert!(covered.iter().all(|count| *count == 1), "{width}x{height}");
        }
    }

    #[test]
    fn medians() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(Vec::new()), None);
    }
}
