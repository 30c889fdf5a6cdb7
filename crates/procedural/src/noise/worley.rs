//! Worley's cellular noise in two dimensions (Worley 1996, "A cellular texture basis function"): distances to the
//! nearest of random points, of which each cell has one.

use super::cell::{cell_component, component_at};
use super::hash::cell_of;
use super::perlin::Channel;

/// A point of a neighbouring cell.
#[derive(Clone, Copy)]
struct Point {
    /// From the place asked for to the point.
    offset: [f64; 2],
    /// The derivative of `offset` in the jitter.
    slope: [f64; 2],
    /// The squared length of `offset`.
    square: f64,
}

impl Point {
    const NONE: Self = Self { offset: [0.0; 2], slope: [0.0; 2], square: 1e6 };
}

/// The three nearest points of the nine cells around a place, nearest first. Ties keep the order of the cells.
fn nearest(x: f64, y: f64, jitter: f64) -> [Point; 3] {
    let ((i, fx), (j, fy)) = (cell_of(x), cell_of(y));
    let mut found = [Point::NONE; 3];
    for di in -1..=1 {
        for dj in -1..=1 {
            let (ci, cj) = (i.wrapping_add(di), j.wrapping_add(dj));
            let slope = [component_at(ci, cj, 0) - 0.5, component_at(ci, cj, 1) - 0.5];
            let offset = [f64::from(di) + 0.5 + slope[0] * jitter - fx, f64::from(dj) + 0.5 + slope[1] * jitter - fy];
            let square = offset[0] * offset[0] + offset[1] * offset[1];
            insert(&mut found, Point { offset, slope, square });
        }
    }
    found
}

fn insert(found: &mut [Point; 3], point: Point) {
    let at = found.iter().position(|other| point.square < other.square);
    if let Some(at) = at {
        found[at..].rotate_right(1);
        found[at] = point;
    }
}

/// The distance to the nearest point (`rank` 0), the second or the third, and its derivatives in x, y and the jitter.
pub fn distance(x: f64, y: f64, jitter: f64, rank: usize) -> [f64; 4] {
    let Point { offset, slope, square } = nearest(x, y, jitter)[rank];
    let distance = square.sqrt();
    if distance == 0.0 {
        return [0.0; 4];
    }
    let [ux, uy] = [offset[0] / distance, offset[1] / distance];
    [distance, -ux, -uy, ux * slope[0] + uy * slope[1]]
}

/// The random number of the nearest point's cell, from 0 to 1.
pub fn nearest_cell(x: f64, y: f64, jitter: f64, channel: Channel) -> f64 {
    let [dx, dy] = nearest(x, y, jitter)[0].offset;
    match channel {
        Channel::Scalar => super::cell::cell(x + dx, y + dy),
        Channel::Component(at) => cell_component(x + dx, y + dy, i32::from(at)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Without jitter the points are the cells' centres.
    #[test]
    fn without_jitter_distances_are_known() {
        assert_eq!(distance(0.5, 0.5, 0.0, 0)[0], 0.0);
        assert_eq!(distance(0.5, 0.75, 0.0, 0)[0], 0.25);
        assert_eq!(distance(0.5, 0.75, 0.0, 1)[0], 0.75);
        assert_ne!(distance(0.5, 0.75, 1.0, 0)[0], 0.25);
    }

    proptest! {
        #[test]
        fn distances_ascend_and_derivatives_are_those_of_central_differences(
            x in -9.0..9.0_f64, y in -9.0..9.0_f64, jitter in 0.3..1.0_f64,
        ) {
            let all = [0, 1, 2].map(|rank| distance(x, y, jitter, rank)[0]);
            prop_assert!(all[0] <= all[1] && all[1] <= all[2]);
            // Away from places that are equally far from two points, and from points.
            prop_assume!(all[0] > 1e-3 && all[1] - all[0] > 1e-3);
            let at = [x, y, jitter];
            let slopes = distance(x, y, jitter, 0);
            for k in 0..3 {
                let (mut above, mut below) = (at, at);
                above[k] += 1e-7;
                below[k] -= 1e-7;
                let value = |p: [f64; 3]| distance(p[0], p[1], p[2], 0)[0];
                let difference = (value(above) - value(below)) / 2e-7;
                prop_assert!((difference - slopes[k + 1]).abs() < 1e-4, "{k}: {difference} {}", slopes[k + 1]);
            }
        }

        #[test]
        fn the_nearest_cell_is_constant_around_its_point(x in -9.0..9.0_f64, y in -9.0..9.0_f64) {
            let [d, dx, dy, _] = distance(x, y, 1.0, 0);
            // Halfway to the nearest point the same point is nearest.
            let (nearer_x, nearer_y) = (x - 0.5 * d * dx, y - 0.5 * d * dy);
            let numbers = [(x, y), (nearer_x, nearer_y)].map(|(x, y)| nearest_cell(x, y, 1.0, Channel::Scalar));
            prop_assume!(cell_of(x).0 == cell_of(nearer_x).0 && cell_of(y).0 == cell_of(nearer_y).0);
            prop_assert_eq!(numbers[0], numbers[1]);
        }
    }
}
