//! The walls of a building: upright pieces of its architecture, each in one plane and connected.
//!
//! A wall grows from the largest triangle that belongs to none yet. It takes in every triangle of that triangle's plane that
//! is connected with it: no farther from one of its triangles than the tolerance, so that they share a corner or an edge,
//! touch or overlap. Coplanar walls of different rooms are different walls.

use glam::{DVec2, DVec3};

use crate::rectangle::Rectangle;
use crate::rules::StageRules;

/// An upright triangle.
struct Upright {
    corners: [DVec3; 3],
    /// Unit length.
    normal: DVec3,
    /// In square metres.
    area: f64,
}

impl Upright {
    /// None where the triangle has no area or is not upright.
    fn new(rules: &StageRules, corners: [DVec3; 3]) -> Option<Self> {
        let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let normal = cross.try_normalize()?;
        (normal.y.abs() <= rules.upright_sine).then_some(Self { corners, normal, area: 0.5 * cross.length() })
    }

    /// Whether `other` lies in the plane of this triangle, whichever way it faces.
    fn is_coplanar(&self, rules: &StageRules, other: &Self) -> bool {
        let is_near = |corner: &DVec3| (*corner - self.corners[0]).dot(self.normal).abs() <= rules.same_plane_m;
        self.normal.cross(other.normal).length() <= rules.upright_sine && other.corners.iter().all(is_near)
    }
}

/// The rectangle around each wall of at least [`StageRules::least_wall_m`] in width and height; the wall with the largest
/// triangle first.
pub(crate) fn walls(rules: &StageRules, triangles: impl Iterator<Item = [DVec3; 3]>) -> Vec<Rectangle> {
    let mut rest: Vec<Upright> = triangles.filter_map(|corners| Upright::new(rules, corners)).collect();
    rest.sort_by(|a, b| b.area.total_cmp(&a.area));
    let mut walls = Vec::new();
    while !rest.is_empty() {
        let seed = rest.remove(0);
        walls.extend(grown(rules, &seed, &mut rest));
    }
    walls
}

/// Takes the triangles of the wall around `seed` out of `rest`; returns the rectangle around them if it is large enough.
fn grown(rules: &StageRules, seed: &Upright, rest: &mut Vec<Upright>) -> Option<Rectangle> {
    let up = (DVec3::Y - seed.normal * seed.normal.y).normalize();
    let along = up.cross(seed.normal);
    let flat = |triangle: &Upright| triangle.corners.map(|corner| DVec2::new(corner.dot(along), corner.dot(up)));
    let (mut coplanar, others): (Vec<_>, Vec<_>) =
        rest.drain(..).partition(|triangle| seed.is_coplanar(rules, triangle));
    *rest = others;
    // Take in what is near any triangle of the wall until nothing is.
    let mut wall = vec![flat(seed)];
    let mut done = 0;
    while done < wall.len() {
        let (near, far): (Vec<_>, Vec<_>) =
            coplanar.into_iter().partition(|other| distance(&wall[done], &flat(other)) <= rules.same_plane_m);
        wall.extend(near.iter().map(flat));
        coplanar = far;
        done += 1;
    }
    rest.extend(coplanar);
    rest.sort_by(|a, b| b.area.total_cmp(&a.area));
    // The rectangle around the wall.
    let corners = || wall.iter().flatten().copied();
    let low = corners().reduce(DVec2::min)?;
    let high = corners().reduce(DVec2::max)?;
    let size = high - low;
    let corner = seed.normal * seed.corners[0].dot(seed.normal) + along * low.x + up * low.y;
    (size.min_element() >= rules.least_wall_m).then_some(Rectangle { corner, sides: [along * size.x, up * size.y] })
}

/// The distance of two triangles in a plane; 0 where they overlap.
fn distance(a: &[DVec2; 3], b: &[DVec2; 3]) -> f64 {
    if contains(a, b[0]) || contains(b, a[0]) {
        return 0.0;
    }
    let edges = |triangle: &[DVec2; 3]| [0, 1, 2].map(|k| [triangle[k], triangle[(k + 1) % 3]]);
    let pairs = edges(a).into_iter().flat_map(|one| edges(b).map(|other| (one, other)));
    pairs.map(|(one, other)| edge_distance(one, other)).fold(f64::INFINITY, f64::min)
}

fn contains(triangle: &[DVec2; 3], place: DVec2) -> bool {
    let side = |k: usize| (triangle[(k + 1) % 3] - triangle[k]).perp_dot(place - triangle[k]);
    let sides = [0, 1, 2].map(side);
    sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
}

/// The distance of two line segments.
fn edge_distance([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> f64 {
    let side = |from: DVec2, to: DVec2, place: DVec2| (to - from).perp_dot(place - from);
    if side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0 {
        return 0.0;
    }
    let to_edge = |place: DVec2, from: DVec2, to: DVec2| {
        let edge = to - from;
        let share = ((place - from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        place.distance(from + edge * share)
    };
    [to_edge(a, c, d), to_edge(b, c, d), to_edge(c, a, b), to_edge(d, a, b)].into_iter().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles that make a rectangle in the plane x = `x`, from `low` to `high` in z and y.
    fn sheet(x: f64, low: [f64; 2], high: [f64; 2]) -> Vec<[DVec3; 3]> {
        let at = |z: f64, y: f64| DVec3::new(x, y, z);
        let [a, b, c, d] = [at(low[0], low[1]), at(high[0], low[1]), at(high[0], high[1]), at(low[0], high[1])];
        vec![[a, b, c], [a, c, d]]
    }

    fn found(triangles: Vec<[DVec3; 3]>) -> Vec<[f64; 2]> {
        let walls = walls(&StageRules::default(), triangles.into_iter());
        walls.iter().map(|wall| wall.sides.map(|side| (side.length() * 1e6).round() / 1e6)).collect()
    }

    #[test]
    fn coplanar_walls_of_two_rooms_are_two() {
        let apart = [sheet(1.0, [0.0, 0.0], [4.0, 2.5]), sheet(1.0, [4.1, 0.0], [6.1, 2.5])].concat();
        assert_eq!(found(apart), [[4.0, 2.5], [2.0, 2.5]]);
        // The twin: no gap between them, and triangles that share no corner.
        let together = [sheet(1.0, [0.0, 0.0], [4.0, 2.5]), sheet(1.0, [4.005, 1.0], [6.0, 2.0])].concat();
        assert_eq!(found(together), [[6.0, 2.5]]);
    }

    #[test]
    fn pieces_around_a_window_are_one_wall() {
        let around = [
            sheet(1.0, [0.0, 0.0], [4.0, 0.8]),
            sheet(1.0, [0.0, 2.0], [4.0, 2.5]),
            sheet(1.0, [0.0, 0.8], [1.0, 2.0]),
            sheet(1.0, [3.0, 0.8], [4.0, 2.0]),
        ];
        assert_eq!(found(around.concat()), [[4.0, 2.5]]);
        // The twin: without what joins them, sill and lintel are two.
        assert_eq!(found(around[..2].concat()), [[4.0, 0.8], [4.0, 0.5]]);
    }

    #[test]
    fn overlapping_sheets_are_one_wall_and_parallel_ones_are_not() {
        let cross = [sheet(1.0, [0.0, 1.0], [4.0, 2.0]), sheet(1.0, [1.0, 0.0], [2.0, 2.5])].concat();
        assert_eq!(found(cross), [[4.0, 2.5]]);
        let parallel = [sheet(1.0, [0.0, 0.0], [4.0, 2.5]), sheet(1.02, [0.0, 0.0], [3.0, 2.5])].concat();
        assert_eq!(found(parallel), [[4.0, 2.5], [3.0, 2.5]]);
    }

    #[test]
    fn neither_order_nor_orientation_matters() {
        let wall = [sheet(1.0, [0.0, 0.0], [4.0, 0.8]), sheet(1.0, [0.0, 0.8], [1.0, 2.0])].concat();
        let mut turned: Vec<[DVec3; 3]> = wall.iter().rev().map(|[a, b, c]| [*a, *c, *b]).collect();
        assert_eq!(found(wall), [[4.0, 2.0]]);
        assert_eq!(found(turned.clone()), [[4.0, 2.0]]);
        // Floors, low ledges and triangles without area are no walls.
        turned.clear();
        turned.extend(sheet(1.0, [0.0, 0.0], [4.0, 0.4]));
        turned.push([DVec3::ZERO, DVec3::X * 4.0, DVec3::Z * 4.0]);
        turned.push([DVec3::ZERO, DVec3::Y, DVec3::Y * 2.0]);
        assert!(found(turned).is_empty());
    }
}
