//! Statistics of a texture whose phase is random, from the same points for what is seen and for what a graph shows.
//!
//! Points are scattered, so that statistics are taken from pairs of them by distance and direction: structure functions
//! (mean squares of differences over a distance; Kolmogorov 1941, variograms in geostatistics) of the logarithm of the
//! brightness at nine distances and six directions, their sparseness and asymmetry, quantiles, and structure functions
//! of chromaticity.

use std::f64::consts::PI;

use super::least_squares::{FLOOR, smooth_part_of};
use super::{Point, extent, median};
use crate::noise::cell;

pub(super) const SCALES: usize = 9;

/// The number of directions, over half a turn.
pub(super) const DIRECTIONS: usize = 6;

/// The most pairs of a distance and direction.
const MOST_PAIRS: usize = 64;

/// From this number of points on, no others are taken.
const MOST_POINTS: usize = 1400;

/// The greatest distance of a bin over its least.
const WIDTH: f64 = 1.35;

/// Points, and pairs of them for each scale and direction.
pub(super) struct Pairs {
    /// The points that belong to a pair.
    pub(super) points: Vec<Point>,
    /// Pairs of places in `points`, by scale and then by direction.
    pub(super) bins: Vec<Vec<[usize; 2]>>,
}

impl Pairs {
    /// Pairs at distances from a footprint up to 40 % of the extent. Near ones are sought first, among all points; far
    /// ones among the points that near ones use.
    pub(super) fn new(all: &[Point]) -> Self {
        let [width, height] = extent(all);
        let most = 0.4 * width.max(height);
        let least = 1.2 * median(all.iter().map(|point| point.footprint).collect());
        let step = libm::pow((most / least).max(1.0), 1.0 / (SCALES - 1) as f64);
        let mut order: Vec<usize> = (0..all.len()).collect();
        order.sort_by(|a, b| random(*a).total_cmp(&random(*b)));
        let mut used = vec![false; all.len()];
        let mut bins = Vec::new();
        let mut radius = least;
        for _ in 0..SCALES {
            let found = within(all, &order, radius);
            found.iter().flatten().flatten().for_each(|&at| used[at] = true);
            if used.iter().filter(|used| **used).count() > MOST_POINTS {
                order.retain(|at| used[*at]);
            }
            bins.extend(found);
            radius *= step;
        }
        Self::compact(all, &used, bins)
    }

    /// Keeps the points that are used.
    fn compact(all: &[Point], used: &[bool], mut bins: Vec<Vec<[usize; 2]>>) -> Self {
        let mut places = vec![0; all.len()];
        let mut points = Vec::new();
        for (at, point) in all.iter().enumerate().filter(|(at, _)| used[*at]) {
            places[at] = points.len();
            points.push(*point);
        }
        bins.iter_mut().flatten().flatten().for_each(|at| *at = places[*at]);
        Self { points, bins }
    }
}

fn random(at: usize) -> f64 {
    cell(at as f64 + 0.5, 77.5)
}

/// Pairs at a distance from `radius` to [`WIDTH`] times that, for each direction.
fn within(all: &[Point], order: &[usize], radius: f64) -> Vec<Vec<[usize; 2]>> {
    let most = radius * WIDTH;
    let grid = Grid::new(all, order, most);
    let mut bins = vec![Vec::new(); DIRECTIONS];
    for &first in order {
        if bins.iter().all(|bin| bin.len() >= MOST_PAIRS) {
            break;
        }
        // A few partners for each point, so that pairs come from everywhere.
        let mut partners = 0;
        for second in grid.around(&all[first]) {
            let (du, dv) = (all[second].u - all[first].u, all[second].v - all[first].v);
            let distance = libm::hypot(du, dv);
            if second <= first || distance < radius || distance >= most {
                continue;
            }
            let turn = libm::atan2(dv, du).rem_euclid(PI) / PI * DIRECTIONS as f64;
            let bin: &mut Vec<[usize; 2]> = &mut bins[(turn.round() as usize) % DIRECTIONS];
            if bin.len() < MOST_PAIRS {
                bin.push([first, second]);
                partners += 1;
            }
            if partners >= 8 {
                break;
            }
        }
    }
    bins
}

/// Points sorted into square cells.
struct Grid {
    side: f64,
    origin: [f64; 2],
    columns: usize,
    rows: usize,
    cells: Vec<Vec<usize>>,
}

impl Grid {
    fn new(all: &[Point], order: &[usize], side: f64) -> Self {
        let [width, height] = extent(all);
        // At most a million cells, however small they should be.
        let side = side.max(width.max(height) / 1000.0).max(1e-12);
        let least = |of: fn(&Point) -> f64| all.iter().map(of).fold(f64::MAX, f64::min);
        let origin = [least(|point| point.u), least(|point| point.v)];
        let (columns, rows) = ((width / side) as usize + 1, (height / side) as usize + 1);
        let mut grid = Self { side, origin, columns, rows, cells: vec![Vec::new(); columns * rows] };
        for &at in order {
            let [column, row] = grid.cell(&all[at]);
            grid.cells[row * columns + column].push(at);
        }
        grid
    }

    fn cell(&self, point: &Point) -> [usize; 2] {
        let column = ((point.u - self.origin[0]) / self.side) as usize;
        let row = ((point.v - self.origin[1]) / self.side) as usize;
        [column.min(self.columns - 1), row.min(self.rows - 1)]
    }

    /// The points of the cell and those around it.
    fn around(&self, point: &Point) -> impl Iterator<Item = usize> {
        let [column, row] = self.cell(point);
        let rows = row.saturating_sub(1)..(row + 2).min(self.rows);
        let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
        rows.flat_map(move |row| columns.clone().map(move |column| row * self.columns + column))
            .flat_map(|cell| self.cells[cell].iter().copied())
    }
}

/// What is added to structure functions, so that their logarithms are finite and faint differences do not count.
const LEAST_SQUARE: f64 = 4e-4;

/// The same for chromaticity.
const LEAST_CHROMA: f64 = 2e-4;

/// The most noise of the points that is not part of a pattern, relative to their colours (standard deviation).
const MOST_NOISE: f64 = 0.08;

/// How far noise is shifted among the points for another number.
const NOISE_STEP: usize = 97;

/// The shares of points below which quantiles are taken.
const SHARES: [f64; 8] = [0.02, 0.05, 0.1, 0.25, 0.75, 0.9, 0.95, 0.98];

pub(super) const COUNT: usize = SCALES * DIRECTIONS + 3 * SCALES + SHARES.len() + 2;

/// The standard deviation of each statistic that is expected of the same texture at other places.
const SPREADS: [f64; 6] = [0.35, 0.12, 0.3, 0.3, 0.25, 0.25];

/// Statistics in a fixed order.
#[derive(Clone, Debug)]
pub(super) struct Statistics {
    pub(super) numbers: [f64; COUNT],
}

/// The kind of a statistic, as a place in [`SPREADS`].
fn kind(at: usize) -> usize {
    let from = SCALES * DIRECTIONS;
    match at {
        _ if at < from => 0,
        _ if at < from + SCALES => 1,
        _ if at < from + 2 * SCALES => 2,
        _ if at < from + 3 * SCALES => 3,
        _ if at < from + 3 * SCALES + SHARES.len() => 4,
        _ => 5,
    }
}

/// The expected standard deviation of a statistic.
pub(super) fn spread(at: usize) -> f64 {
    SPREADS[kind(at)]
}

/// What is seen, ready to be compared.
pub(super) struct Target {
    pub(super) pairs: Pairs,
    pub(super) seen: Statistics,
    /// The structure functions of what is seen.
    squares: Vec<f64>,
    /// A standard normal number for each point.
    normal: Vec<f64>,
}

impl Target {
    /// The statistics of points without their smooth part.
    pub(super) fn new(points: &[Point]) -> Self {
        let pairs = Pairs::new(points);
        let colors: Vec<[f64; 3]> = pairs.points.iter().map(|point| point.albedo).collect();
        let values = Values::new(&pairs, &colors);
        let squares = squares(&pairs, &values.grey);
        let normal = (0..pairs.points.len()).map(normal).collect();
        let seen = Statistics { numbers: numbers(&pairs, &values, &squares) };
        Self { pairs, seen, squares, normal }
    }

    /// The logarithm of the brightness seen at each point, without its smooth part.
    pub(super) fn brightness(&self) -> Vec<f64> {
        let colors: Vec<[f64; 3]> = self.pairs.points.iter().map(|point| point.albedo).collect();
        Values::new(&self.pairs, &colors).grey
    }

    /// The statistics of a graph's colours at the points, after the noise that agrees best is added: that of this
    /// number.
    pub(super) fn of(&self, colors: &[[f64; 3]], number: usize) -> Statistics {
        let mut values = Values::new(&self.pairs, colors);
        let noise = self.noise(&squares(&self.pairs, &values.grey));
        let deviation = noise.sqrt();
        let normal = self.normal.iter().cycle().skip(NOISE_STEP * number);
        values.grey.iter_mut().zip(normal).for_each(|(value, normal)| *value += deviation * normal);
        let squares = squares(&self.pairs, &values.grey);
        Statistics { numbers: numbers(&self.pairs, &values, &squares) }
    }

    /// The variance of white noise that brings structure functions closest to those seen, by relative least squares.
    fn noise(&self, own: &[f64]) -> f64 {
        let (mut product, mut square) = (0.0, 0.0);
        for (seen, own) in self.squares.iter().zip(own) {
            let slope = 2.0 / (seen + LEAST_SQUARE);
            product += slope * (1.0 - (own + LEAST_SQUARE) / (seen + LEAST_SQUARE));
            square += slope * slope;
        }
        (product / square.max(1e-300)).clamp(0.0, MOST_NOISE * MOST_NOISE)
    }

    /// The mean square of the differences from what is seen, in units of what is expected by chance.
    pub(super) fn distance(&self, own: &Statistics) -> f64 {
        let term = |at: usize| bounded((own.numbers[at] - self.seen.numbers[at]) / spread(at));
        (0..COUNT).map(term).sum::<f64>() / COUNT as f64
    }
}

/// The square, which grows linearly beyond 4.
pub(super) fn bounded(z: f64) -> f64 {
    let size = z.abs();
    if size > 4.0 { 8.0 * size - 16.0 } else { size * size }
}

/// A standard normal number: the sum of twelve uniform ones.
fn normal(at: usize) -> f64 {
    (0..12).map(|k| cell(at as f64 + 0.5, 50.5 + f64::from(k))).sum::<f64>() - 6.0
}

/// Brightness and chromaticity at each point, as logarithms without their smooth part or mean.
struct Values {
    grey: Vec<f64>,
    chroma: [Vec<f64>; 2],
}

impl Values {
    fn new(pairs: &Pairs, colors: &[[f64; 3]]) -> Self {
        let log = |x: f64| libm::log(x.max(0.0) + FLOOR);
        let mut grey: Vec<f64> = colors.iter().map(|c| log((c[0] + c[1] + c[2]) / 3.0)).collect();
        let smooth = smooth_part_of(&pairs.points, &grey);
        grey.iter_mut().zip(smooth).for_each(|(value, smooth)| *value -= smooth);
        let chroma = [0, 2].map(|channel| {
            let mut ratio: Vec<f64> = colors.iter().map(|c| log(c[channel]) - log(c[1])).collect();
            let mean = ratio.iter().sum::<f64>() / ratio.len().max(1) as f64;
            ratio.iter_mut().for_each(|value| *value -= mean);
            ratio
        });
        Self { grey, chroma }
    }
}

/// The structure function at each scale and direction.
fn squares(pairs: &Pairs, values: &[f64]) -> Vec<f64> {
    pairs.bins.iter().map(|bin| mean(bin, |[a, b]| (values[a] - values[b]).powi(2))).collect()
}

fn mean(bin: &[[usize; 2]], of: impl Fn([usize; 2]) -> f64) -> f64 {
    bin.iter().map(|pair| of(*pair)).sum::<f64>() / bin.len().max(1) as f64
}

fn numbers(pairs: &Pairs, values: &Values, squares: &[f64]) -> [f64; COUNT] {
    let mut all = Vec::with_capacity(COUNT);
    all.extend(squares.iter().map(|square| libm::log(square + LEAST_SQUARE)));
    let grey = &values.grey;
    let variance = grey.iter().map(|value| value * value).sum::<f64>() / grey.len().max(1) as f64 + LEAST_SQUARE;
    let scales: Vec<Vec<[usize; 2]>> = pairs.bins.chunks(DIRECTIONS).map(<[_]>::concat).collect();
    // Sparseness: the mean square over the square of the mean size.
    all.extend(scales.iter().map(|bin| {
        let size = mean(bin, |[a, b]| (grey[a] - grey[b]).abs());
        let square = mean(bin, |[a, b]| (grey[a] - grey[b]).powi(2));
        libm::log((square + LEAST_SQUARE) / (size * size + LEAST_SQUARE))
    }));
    // Asymmetry: whether differences are greater at bright places or at dark ones.
    all.extend(scales.iter().map(|bin| {
        let square = mean(bin, |[a, b]| (grey[a] - grey[b]).powi(2)) + LEAST_SQUARE;
        let skewed = mean(bin, |[a, b]| (grey[a] + grey[b]) * (grey[a] - grey[b]).powi(2));
        skewed / (square * variance.sqrt())
    }));
    // Chromaticity.
    let of_chroma = |bin: &Vec<[usize; 2]>| {
        let square = |chroma: &Vec<f64>| mean(bin, |[a, b]| (chroma[a] - chroma[b]).powi(2));
        libm::log(values.chroma.iter().map(square).sum::<f64>() + LEAST_CHROMA)
    };
    all.extend(scales.iter().map(of_chroma));
    // Quantiles of the brightness.
    let mut sorted = grey.clone();
    sorted.sort_by(f64::total_cmp);
    let quantile = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
    let middle = quantile(0.5);
    all.extend(SHARES.map(|share| (quantile(share) - middle) / variance.sqrt()));
    // How chromaticity follows brightness.
    all.extend(values.chroma.each_ref().map(|chroma| {
        let product = chroma.iter().zip(grey).map(|(a, b)| a * b).sum::<f64>() / grey.len().max(1) as f64;
        let square = chroma.iter().map(|a| a * a).sum::<f64>() / grey.len().max(1) as f64 + LEAST_CHROMA;
        product / (square * variance).sqrt()
    }));
    all.try_into().expect("the count is the sum of the parts")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::model::Model;
    use crate::graph::Settings;
    use crate::library::{Class, entry};

    #[test]
    fn pairs_have_their_distance_and_direction() {
        let random = |i: u32, of: f64| cell(f64::from(i) + 0.5, of);
        let at =
            |i: u32| Point { u: random(i, 1.5), v: random(i, 2.5), footprint: 0.004, albedo: [0.5; 3], weight: 1.0 };
        let all: Vec<Point> = (0..3000).map(at).collect();
        let pairs = Pairs::new(&all);
        assert_eq!(pairs.bins.len(), SCALES * DIRECTIONS);
        assert!(pairs.points.len() < 2200, "{}", pairs.points.len());
        let mut lengths = Vec::new();
        for (number, bin) in pairs.bins.iter().enumerate() {
            assert!(bin.len() >= 8, "{number}: {}", bin.len());
            let apart = |&[a, b]: &[usize; 2]| {
                let (a, b) = (pairs.points[a], pairs.points[b]);
                [b.u - a.u, b.v - a.v]
            };
            for [du, dv] in bin.iter().map(apart) {
                let turn = dv.atan2(du).to_degrees() - 30.0 * (number % DIRECTIONS) as f64;
                assert!((turn - 180.0 * (turn / 180.0).round()).abs() < 15.1, "{turn}");
            }
            let mean = bin.iter().map(apart).map(|[du, dv]| du.hypot(dv)).sum::<f64>() / bin.len() as f64;
            lengths.push(mean);
        }
        assert!(lengths[0] < 0.007 && lengths[SCALES * DIRECTIONS - 1] > 0.39);
    }

    fn places(first: u32) -> Vec<Point> {
        let random = |i: u32, of: f64| cell(f64::from(i + first) + 0.5, of);
        let place = |i: u32| Point {
            u: 0.4 * random(i, 1.5),
            v: 0.4 * random(i, 2.5),
            footprint: 0.001,
            albedo: [0.0; 3],
            weight: 1.0,
        };
        (0..2500).map(place).collect()
    }

    /// The same texture elsewhere is close, one of another size is not, and neither is one of another kind.
    #[test]
    fn statistics_know_a_texture_by_its_size_and_kind() {
        let model = |name: &str| Model::new(entry(name).unwrap().graph().unwrap(), Some(Class::Isotropic));
        let roughcast = model("roughcast");
        let of_size = |size: f64, shift: f64| {
            let mut settings = Settings::defaults(&roughcast.graph);
            roughcast.set(&mut settings, "stone_size", size);
            roughcast.set(&mut settings, "t_u", shift);
            settings
        };
        let target = Target::new(&roughcast.shown(&of_size(0.012, 0.0), &places(0)));
        let colors = |points: Vec<Point>| -> Vec<[f64; 3]> { points.iter().map(|point| point.albedo).collect() };
        let distance = |shown: Vec<Point>| target.distance(&target.of(&colors(shown), 1));
        let same = distance(roughcast.shown(&of_size(0.012, 4.3), &target.pairs.points));
        let larger = distance(roughcast.shown(&of_size(0.024, 4.3), &target.pairs.points));
        let terrazzo = model("terrazzo");
        let other = distance(terrazzo.shown(&Settings::defaults(&terrazzo.graph), &target.pairs.points));
        assert!(same < 1.0 && larger > 2.0 * same && other > 4.0 * same, "{same} {larger} {other}");
        // Exactly the same colours have no distance but that of the noise that is added.
        let own: Vec<Point> = target.pairs.points.clone();
        assert!(distance(own) < 0.05);
    }
}
