//! Texels that the input view does not show, from those that it shows.

use std::collections::HashSet;
use std::f32::consts::FRAC_1_SQRT_2;
use std::num::NonZero;

use glam::{DVec2, DVec3, Mat3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use mateval_scene::TriangleMesh;
use rayon::prelude::*;

use crate::estimate::Values;
use crate::lift::{PartialAtlas, Texel, place_of};
use crate::seen::SeenPoint;

/// How an unseen texel follows from seen ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillRule {
    /// 1: the nearest (the paper); more: their mean, weighted by the inverse square of the distance (Point-UV Diffusion
    /// takes 3).
    pub neighbours: NonZero<usize>,
    /// Metres that opposite normals count as, half of which is that of normals at right angles, roughly; 0: normals do not
    /// count.
    pub normal_weight_m: f64,
}

impl Default for FillRule {
    fn default() -> Self {
        Self { neighbours: NonZero::<usize>::MIN, normal_weight_m: 0.0 }
    }
}

/// A place in space, with its normal where that counts.
type Point = [f32; 6];

/// What the pixels of an estimate show, as points in space (the paper's partial point cloud), to be found by place.
pub struct SeenCloud {
    rule: FillRule,
    /// None: nothing is seen.
    tree: Option<Tree>,
    values: Vec<Values>,
}

/// A tree of three axes is faster: normals are left out where they do not count.
///
/// Points are turned before they go in: on a wall along an axis all would have one coordinate in common, and a tree that
/// splits by coordinates cannot part them.
enum Tree {
    Places(ImmutableKdTree<f32, 3>),
    WithNormals(ImmutableKdTree<f32, 6>),
}

impl Tree {
    fn new(rule: FillRule, points: &[Point]) -> Self {
        if rule.normal_weight_m > 0.0 {
            let turned: Vec<Point> = points.iter().map(turned_with_normal).collect();
            return Self::WithNormals(ImmutableKdTree::new_from_slice(&turned));
        }
        let turned: Vec<[f32; 3]> = points.iter().map(turned_place).collect();
        Self::Places(ImmutableKdTree::new_from_slice(&turned))
    }

    fn nearest(&self, point: &Point) -> usize {
        let item = match self {
            Self::Places(tree) => tree.nearest_one::<SquaredEuclidean>(&turned_place(point)).item,
            Self::WithNormals(tree) => tree.nearest_one::<SquaredEuclidean>(&turned_with_normal(point)).item,
        };
        item as usize
    }

    /// Squared distance and item of each.
    fn nearest_n(&self, point: &Point, count: NonZero<usize>) -> Vec<(f32, usize)> {
        let found = match self {
            Self::Places(tree) => tree.nearest_n::<SquaredEuclidean>(&turned_place(point), count),
            Self::WithNormals(tree) => tree.nearest_n::<SquaredEuclidean>(&turned_with_normal(point), count),
        };
        found.into_iter().map(|near| (near.distance, near.item as usize)).collect()
    }
}

impl SeenCloud {
    /// Takes in points and what the estimate says of each.
    pub fn new(rule: FillRule, seen: impl IntoIterator<Item = (SeenPoint, Values)>) -> Self {
        let (mut points, mut values, mut places) = (Vec::new(), Vec::new(), HashSet::new());
        for (seen, value) in seen {
            let point = point(rule, seen.place, seen.normal);
            // The first of several at one place: no tree could part them.
            if places.insert(point.map(f32::to_bits)) {
                points.push(point);
                values.push(value);
            }
        }
        let tree = (!points.is_empty()).then(|| Tree::new(rule, &points));
        Self { rule, tree, values }
    }

    /// Gives every unseen texel what the points nearest to it say; false where nothing is seen. Seen texels stay as they are.
    pub fn fill(&self, known: &mut PartialAtlas, mesh: &TriangleMesh) -> bool {
        let Some(tree) = &self.tree else { return false };
        let size = known.atlas.size();
        let found: Vec<Option<Values>> = {
            let known = &*known;
            let unseen = |at: usize| match (known.texels.pixels()[at], known.atlas.owner(at % size, at / size)) {
                (Texel::Unseen, Some((triangle, _))) => {
                    let centre = DVec2::new((at % size) as f64 + 0.5, (at / size) as f64 + 0.5);
                    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
                    let normal = (b - a).cross(c - a).normalize_or_zero();
                    let place = place_of(&known.atlas, mesh, triangle, centre);
                    Some(self.values_at(tree, &point(self.rule, place, normal)))
                }
                _ => None,
            };
            (0..size * size).into_par_iter().map(unseen).collect()
        };
        for (texel, value) in known.texels.pixels_mut().iter_mut().zip(found) {
            if let Some(value) = value {
                *texel = Texel::Seen(value);
            }
        }
        true
    }

    fn values_at(&self, tree: &Tree, point: &Point) -> Values {
        if self.rule.neighbours.get() == 1 {
            return self.values[tree.nearest(point)];
        }
        let count = self.rule.neighbours.min(NonZero::new(self.values.len()).unwrap_or(NonZero::<usize>::MIN));
        let (mut sum, mut weights) = ([0.0_f64; 5], 0.0);
        for (distance2, item) in tree.nearest_n(point, count) {
            // At a seen point itself that one outweighs all others.
            let weight = 1.0 / f64::from(distance2).max(1e-12);
            sum.iter_mut().zip(self.values[item]).for_each(|(sum, value)| *sum += weight * f64::from(value));
            weights += weight;
        }
        sum.map(|sum| (sum / weights) as f32)
    }
}

/// A rotation about no axis of a room.
fn turn() -> Mat3 {
    Mat3::from_cols(Vec3::new(2.0, 3.0, 6.0), Vec3::new(3.0, -6.0, 2.0), Vec3::new(6.0, 2.0, -3.0)) * (1.0 / 7.0)
}

fn turned_place(point: &Point) -> [f32; 3] {
    (turn() * Vec3::new(point[0], point[1], point[2])).to_array()
}

/// A rotation of all six: what is flat has one normal, so places and normals are mixed.
fn turned_with_normal(point: &Point) -> Point {
    let place = turn() * Vec3::new(point[0], point[1], point[2]);
    let normal = turn() * Vec3::new(point[3], point[4], point[5]);
    let (sum, difference) = ((place + normal) * FRAC_1_SQRT_2, (place - normal) * FRAC_1_SQRT_2);
    [sum.x, sum.y, sum.z, difference.x, difference.y, difference.z]
}

fn point(rule: FillRule, place: DVec3, normal: DVec3) -> Point {
    // Opposite unit normals lie two apart.
    let (place, normal) = (place.as_vec3(), (normal * (rule.normal_weight_m / 2.0)).as_vec3());
    [place.x, place.y, place.z, normal.x, normal.y, normal.z]
}

#[cfg(test)]
mod tests {
    use mateval_image::Picture;
    use mateval_scene::uv_atlas::UvAtlas;

    use super::*;

    /// A wall along an axis, two metres wide, its uv the unit square.
    fn wall() -> TriangleMesh {
        TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::new(2.0, 2.0, 0.0), Vec3::Y * 2.0],
            normals: None,
            uvs: Some([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(glam::Vec2::from).into()),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    /// The left third is seen; its values say where.
    fn known() -> PartialAtlas {
        let atlas = UvAtlas::new(&wall(), 48);
        let texels = Picture::from_fn(48, 48, |x, y| match x {
            0..16 => Texel::Seen([x as f32, y as f32, 0.0, 0.0, 0.0]),
            _ => Texel::Unseen,
        });
        PartialAtlas { atlas, texels }
    }

    fn seen() -> Vec<(SeenPoint, Values)> {
        let point = |x: usize, y: usize| {
            let place = DVec3::new((x as f64 + 0.3) / 24.0, 2.0 - (y as f64 + 0.6) / 24.0, 0.0);
            (SeenPoint { instance: 0, pixel: (x, y), place, normal: DVec3::Z }, [x as f32, y as f32, 1.0, 0.0, 0.0])
        };
        (0..48).flat_map(|y| (0..16).map(move |x| point(x, y))).collect()
    }

    fn filled(neighbours: usize, normal_weight_m: f64) -> PartialAtlas {
        let rule = FillRule { neighbours: NonZero::new(neighbours).unwrap(), normal_weight_m };
        let mut known = known();
        assert!(SeenCloud::new(rule, seen()).fill(&mut known, &wall()));
        known
    }

    #[test]
    fn the_nearest_is_found_as_by_looking_at_all() {
        for weight in [0.0, 0.3] {
            let filled = filled(1, weight);
            for (x, y) in [(16, 0), (20, 33), (47, 47), (30, 7)] {
                let centre = DVec3::new((x as f64 + 0.5) / 24.0, 2.0 - (y as f64 + 0.5) / 24.0, 0.0);
                let all = seen();
                let nearest = all
                    .iter()
                    .min_by(|a, b| a.0.place.distance_squared(centre).total_cmp(&b.0.place.distance_squared(centre)));
                assert_eq!(filled.texels.get(x, y), Texel::Seen(nearest.unwrap().1));
            }
        }
    }

    #[test]
    fn three_are_weighted_by_the_inverse_square() {
        let filled = filled(3, 0.0);
        let centre = DVec3::new(20.5 / 24.0, 2.0 - 10.5 / 24.0, 0.0);
        let mut all = seen();
        all.sort_by(|a, b| a.0.place.distance_squared(centre).total_cmp(&b.0.place.distance_squared(centre)));
        let weights: Vec<f64> = all[..3].iter().map(|(point, _)| 1.0 / point.place.distance_squared(centre)).collect();
        let mean = |c: usize| {
            let sum: f64 = all[..3].iter().zip(&weights).map(|((_, value), weight)| weight * f64::from(value[c])).sum();
            (sum / weights.iter().sum::<f64>()) as f32
        };
        let Texel::Seen(found) = filled.texels.get(20, 10) else { panic!("not filled") };
        assert!((found[0] - mean(0)).abs() < 1e-3 && (found[1] - mean(1)).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn what_is_seen_stays() {
        for neighbours in [1, 3] {
            let filled = filled(neighbours, 0.0);
            for (before, after) in known().texels.pixels().iter().zip(filled.texels.pixels()) {
                assert!(*before == Texel::Unseen || before == after);
                assert!(*after != Texel::Unseen);
            }
        }
    }

    #[test]
    fn from_nothing_follows_nothing() {
        assert!(!SeenCloud::new(FillRule::default(), []).fill(&mut known(), &wall()));
        // All at one place: a tree of them would have no way to split.
        let (point, value) = seen()[0];
        let many = std::iter::repeat_n((point, value), 100_000);
        assert!(SeenCloud::new(FillRule::default(), many).fill(&mut known(), &wall()));
    }
}
