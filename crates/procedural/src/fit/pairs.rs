//! Pairs of points by distance and direction: what statistics of a texture are taken from where points are scattered.

use std::f64::consts::PI;

use super::points::{Point, extent, median};
use crate::noise::cell::cell;

/// The number of distances.
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
