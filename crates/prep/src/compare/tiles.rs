//! The statistics of comparing two renderers' pictures tile by tile: how far means differ, and how far noise alone lets
//! them differ.
//!
//! Each renderer gives two halves of a picture. The mean of a pixel's halves a and b has a variance whose expected value
//! is that of ((a - b) / 2)², whatever the distribution. The variances of a tile's pixels and of both renderers add up.

use std::ops::Range;

use mateval_image::{LinearRgb, Picture};

use super::file::{BOUNDS, FALSE_ALARM, SamplesToDecide};

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
    /// Its standard error.
    pub(super) error: [f64; 3],
    /// The share of its variance that is theirs, 0 to 1; 0 without any noise.
    pub(super) theirs: [f64; 3],
}

/// What a difference may be, as shares of a picture's mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tolerance {
    /// A larger difference is a fault if it exceeds this by `errors` standard errors.
    pub(super) bound: f64,
    pub(super) errors: f64,
    /// A fault that is found where the difference agrees.
    pub(super) fault: f64,
}

impl Tolerance {
    /// That of a tile whose bound this is.
    pub(super) fn of_tile(bound: f64) -> Self {
        Self { bound, errors: BOUNDS.standard_errors, fault: BOUNDS.tile_fault * bound }
    }

    /// That of a picture's mean.
    pub(super) const PICTURE: Self =
        Self { bound: BOUNDS.picture_mean, errors: BOUNDS.standard_errors_mean, fault: BOUNDS.picture_mean_fault };
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
    let (mut sum, mut own, mut other, mut count) = ([0.0_f64; 3], [0.0_f64; 3], [0.0_f64; 3], 0_usize);
    for (x, y) in pixels {
        let [a, b, p, q] = [&ours.a, &ours.b, &theirs.a, &theirs.b].map(|half| half.get(x, y).0.map(f64::from));
        for c in 0..3 {
            sum[c] += (p[c] + q[c] - a[c] - b[c]) / 2.0;
            own[c] += ((a[c] - b[c]) / 2.0).powi(2);
            other[c] += ((p[c] - q[c]) / 2.0).powi(2);
        }
        count += 1;
    }
    let count = count.max(1) as f64;
    let variance = |c: usize| own[c] + other[c];
    Difference {
        mean: sum.map(|sum| sum / count),
        error: std::array::from_fn(|c| variance(c).sqrt() / count),
        theirs: std::array::from_fn(|c| if variance(c) > 0.0 { other[c] / variance(c) } else { 0.0 }),
    }
}

impl Difference {
    /// The difference in each channel divided by what is allowed there: the bound times `scale`, plus the standard
    /// errors. Above 1 the channel is over the bound; a channel that is black in both pictures gives 0.
    pub(super) fn excess(&self, allowed: Tolerance, scale: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|c| match self.mean[c].abs() {
            0.0 => 0.0,
            off => off / (allowed.bound * scale[c] + allowed.errors * self.error[c]),
        })
    }

    /// The channel with the largest [`Self::excess`].
    pub(super) fn worst_channel(&self, allowed: Tolerance, scale: [f64; 3]) -> usize {
        let excess = self.excess(allowed, scale);
        (1..3).fold(0, |worst, c| if excess[c] > excess[worst] { c } else { worst })
    }

    /// Whether any channel is over the bound.
    pub(super) fn is_over(&self, allowed: Tolerance, scale: [f64; 3]) -> bool {
        self.excess(allowed, scale).iter().any(|excess| *excess > 1.0)
    }

    /// Whether a fault could hide in the noise of a channel: the difference and three standard errors exceed it.
    pub(super) fn is_open(&self, allowed: Tolerance, scale: [f64; 3]) -> bool {
        let reach = |c: usize| self.mean[c].abs() + BOUNDS.standard_errors * self.error[c];
        (0..3).any(|c| reach(c) > allowed.fault * scale[c])
    }

    /// Three standard errors divided by the bound, in the channel with the largest quotient; absent if `scale` is 0
    /// in every channel.
    pub(super) fn noise(&self, bound: f64, scale: [f64; 3]) -> Option<f64> {
        let of = |c: usize| (scale[c] > 0.0).then(|| BOUNDS.standard_errors * self.error[c] / (bound * scale[c]));
        (0..3).filter_map(of).max_by(f64::total_cmp)
    }

    /// The samples with which every channel would be decided, if the difference stays what it is: either it is over the
    /// bound, or no fault can hide. `samples` are ours and theirs. Absent where no number would, in a channel that is
    /// black in our picture.
    pub(super) fn to_decide(
        self,
        allowed: Tolerance,
        scale: [f64; 3],
        samples: SamplesToDecide,
    ) -> Option<SamplesToDecide> {
        let mut needed = samples;
        for c in (0..3).filter(|c| self.error[*c] > 0.0) {
            let off = self.mean[c].abs();
            let error = ((allowed.fault * scale[c] - off) / BOUNDS.standard_errors)
                .max((off - allowed.bound * scale[c]) / allowed.errors);
            if error <= 0.0 {
                return None;
            }
            // By how much the variance has to fall; and to which part of it more samples of ours can contribute.
            let factor = (self.error[c] / error).powi(2);
            let theirs = factor * self.theirs[c];
            let own = factor * (1.0 - self.theirs[c]) / (1.0 - theirs);
            let of = |count: u32, factor: f64| (f64::from(count) * factor.max(1.0)).ceil() as u32;
            let more = match theirs < 1.0 && own <= MOST_OF_OURS {
                true => SamplesToDecide { ours: of(samples.ours, own), ..samples },
                false => SamplesToDecide { ours: of(samples.ours, factor), theirs: of(samples.theirs, factor) },
            };
            needed = SamplesToDecide { ours: needed.ours.max(more.ours), theirs: needed.theirs.max(more.theirs) };
        }
        Some(needed)
    }

    /// An upper limit of the probability that noise alone puts it over the bound where the expected values are equal:
    /// two tails of a normal distribution in each channel.
    fn false_alarm(&self, allowed: Tolerance, scale: [f64; 3]) -> f64 {
        let tails = |c: usize| {
            let errors = allowed.errors + allowed.bound * scale[c] / self.error[c];
            if self.error[c] > 0.0 { libm::erfc(errors / std::f64::consts::SQRT_2) } else { 0.0 }
        };
        (0..3).map(tails).sum::<f64>().min(1.0)
    }
}

/// Raises the errors of tiles that look less noisy than light of their brightness is: `means` are ours, tile by tile. Where
/// rare paths bring most of the light, a tile that few of them hit is too dark, and its halves agree nevertheless. The
/// variance of such light is proportional to its mean, by a factor that is the median over the tiles that decide.
pub(super) fn raise_errors(tiles: &mut [Difference], means: &[[f64; 3]], decides: &[bool]) {
    for c in 0..3 {
        let variances = |tile: &Difference| {
            let all = tile.error[c] * tile.error[c];
            [all * (1.0 - tile.theirs[c]), all * tile.theirs[c]]
        };
        let deciding = || tiles.iter().zip(means).zip(decides).filter(|(_, decides)| **decides).map(|(tile, _)| tile);
        let [own, other] = [0, 1].map(|side: usize| {
            let lit = deciding().filter(|(_, mean)| mean[c] > 0.0);
            median(lit.map(|(tile, mean)| variances(tile)[side] / mean[c]).collect()).unwrap_or_default()
        });
        for (tile, mean) in tiles.iter_mut().zip(means) {
            let found = variances(tile);
            let raised = [found[0].max(own * mean[c]), found[1].max(other * mean[c])];
            let all = raised[0] + raised[1];
            tile.error[c] = all.sqrt();
            tile.theirs[c] = if all > 0.0 { raised[1] / all } else { 0.0 };
        }
    }
}

/// More of our samples than this multiple are not worth rendering where theirs are what is noisy.
const MOST_OF_OURS: f64 = 64.0;

/// How many of the tiles may be over the bound, and how many noise alone puts there on average. Allowed are 1 % of the
/// tiles, plus the number that noise alone exceeds at most once in 10,000 pictures. The latter is 0 where the noise is
/// small compared with the bound. Where it is not, three channels at three standard errors would use up the 1 % for
/// noise.
pub(super) fn allowance(tiles: &[Difference], allowed: Tolerance, scale: [f64; 3]) -> (usize, f64) {
    let expected = tiles.iter().map(|tile| tile.false_alarm(allowed, scale)).sum();
    ((BOUNDS.tile_share_over * tiles.len() as f64) as usize + poisson_quantile(expected), expected)
}

/// The smallest k that a Poisson variable of this mean exceeds with a probability of at most [`FALSE_ALARM`].
fn poisson_quantile(mean: f64) -> usize {
    // For a large mean the distribution is nearly normal, and 4 standard deviations cover its skewness as well.
    if mean > 100.0 {
        return (mean + 4.0 * mean.sqrt()).ceil() as usize;
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
