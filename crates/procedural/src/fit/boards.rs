//! Boards in rows that begin at random: the beginning of each row is the one that makes the points of a board most alike.

use super::model::Model;
use super::points::Point;
use super::smooth::log_grey;
use crate::settings::Settings;

/// The number of beginnings of a row that are compared, over the length of a board.
const BEGINNINGS: usize = 12;

/// The number that a board has is that of its row times this, and its place in the row.
const ROW: i64 = 1 << 24;

/// A point in its row.
#[derive(Clone, Copy)]
struct InRow {
    /// The place of the point in the list.
    at: usize,
    row: i64,
    /// Board lengths along the row.
    along: f64,
    log: f64,
    weight: f64,
}

/// The number of each point's board, and the price of having chosen where the rows begin: the logarithm of the number
/// of ways. `sizes` are the slots of the width and the length of a board.
pub(super) fn boards(
    model: &Model,
    settings: &Settings,
    [width, length]: [usize; 2],
    points: &[Point],
) -> (Vec<i64>, f64) {
    let number = |name: &str| model.slot(name).map_or(0.0, |at| settings.numbers()[at]);
    let (sin, cos) = libm::sincos(number("theta").to_radians());
    let (t_u, t_v) = (number("t_u"), number("t_v"));
    let [width, length] = [width, length].map(|at| settings.numbers()[at].max(1e-9));
    let in_row = |(at, point): (usize, &Point)| {
        let (u, v) = (point.u - t_u, point.v - t_v);
        let row = ((v * cos - u * sin) / width).floor() as i64;
        InRow { at, row, along: (u * cos + v * sin) / length, log: log_grey(point), weight: point.weight }
    };
    let mut all: Vec<InRow> = points.iter().enumerate().map(in_row).collect();
    all.sort_by(|a, b| a.row.cmp(&b.row).then(a.along.total_cmp(&b.along)));
    let mut numbers = vec![0; points.len()];
    let mut rows = 0;
    for row in all.chunk_by(|a, b| a.row == b.row) {
        let beginnings = (0..BEGINNINGS).map(|at| at as f64 / BEGINNINGS as f64);
        let best = beginnings.map(|begin| (outer(row, begin), begin)).max_by(|a, b| a.0.total_cmp(&b.0));
        let begin = best.map_or(0.0, |(_, begin)| begin);
        row.iter().for_each(|point| numbers[point.at] = point.row * ROW + board(point, begin));
        rows += 1;
    }
    (numbers, f64::from(rows) * libm::log(BEGINNINGS as f64))
}

fn board(point: &InRow, begin: f64) -> i64 {
    (point.along + begin).floor() as i64
}

/// How much of the squares of a row is between boards: the sum of the squares of their sums over their weights.
fn outer(row: &[InRow], begin: f64) -> f64 {
    let of_board = |points: &[InRow]| {
        let sum: f64 = points.iter().map(|point| point.weight * point.log).sum();
        sum * sum / points.iter().map(|point| point.weight).sum::<f64>()
    };
    row.chunk_by(|a, b| board(a, begin) == board(b, begin)).map(of_board).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::{Class, entry};
    use crate::noise::cell::cell;

    /// Boards whose rows begin elsewhere than the graph's have numbers of their own.
    #[test]
    fn boards_that_begin_anywhere_are_found() {
        let model = Model::new(entry("plank").unwrap().graph().unwrap(), Some(Class::Lattice));
        let settings = model.start();
        let sizes = ["width", "length"].map(|name| model.slot(name).unwrap());
        let [width, length] = sizes.map(|at| settings.numbers()[at]);
        let random = |i: u32, of: f64| cell(f64::from(i) + 0.5, of);
        let planted = |u: f64, v: f64| {
            let row = (v / width).floor();
            [row, (u / length + (8.0 * cell(row + 0.5, 9.5)).floor() / 12.0).floor()]
        };
        let place = |i: u32| {
            let (u, v) = (4.0 * random(i, 1.5), 1.5 * random(i, 2.5));
            let [row, board] = planted(u, v);
            let tone = 0.3 + 0.3 * cell(row + 30.5, board + 40.5);
            Point { u, v, footprint: 0.002, albedo: [tone; 3], weight: 1.0 }
        };
        let points: Vec<Point> = (0..2000).map(place).collect();
        let (found, _) = boards(&model, &settings, sizes, &points);
        let share = |numbers: &[i64]| {
            let is_right = |(i, j): &(usize, usize)| {
                let same = planted(points[*i].u, points[*i].v) == planted(points[*j].u, points[*j].v);
                (numbers[*i] == numbers[*j]) == same
            };
            let pairs: Vec<(usize, usize)> = (0..300).flat_map(|i| (0..i).map(move |j| (i, j))).collect();
            pairs.iter().filter(|pair| is_right(pair)).count() as f64 / pairs.len() as f64
        };
        assert_eq!(share(&found), 1.0);
        // The twin: boards of another length.
        let mut longer = settings.clone();
        *longer.number_mut(sizes[1]) = 1.4 * length;
        assert!(share(&boards(&model, &longer, sizes, &points).0) < 0.999);
    }
}
