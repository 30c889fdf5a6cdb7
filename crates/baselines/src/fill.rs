//! Fills the texels that the input view does not show from the points that it shows.
//!
//! The pixels of an estimate are points in space (the paper's partial point cloud), with nearest-point queries. The
//! tree is an R*-tree and not a k-d tree: a view shows flat pieces of a room, and for a query above such a piece a k-d
//! tree, which bounds points by planes and not by boxes, visits many points beside it (`benches/lifting.rs`).

use std::num::NonZero;

use glam::{DVec2, DVec3};
use mateval_dataset::TriangleMesh;
use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use crate::estimate::Values;
use crate::geometry::SeenPoint;
use crate::lift::{PartialAtlas, Texel, place_of};

/// How the values of an unseen texel are computed from seen points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillRule {
    /// Number of nearest points: 1 in the paper. Several are averaged with the inverse square of the distance as
    /// weight; Point-UV Diffusion uses 3.
    pub neighbours: NonZero<usize>,
    /// Distance that opposite normals count as, in metres; normals at right angles count 0.71 of it. 0 ignores normals.
    pub normal_weight_m: f64,
}

impl Default for FillRule {
    fn default() -> Self {
        Self { neighbours: NonZero::<usize>::MIN, normal_weight_m: 0.0 }
    }
}

/// Seen points with the values of the estimate at each.
pub struct SeenCloud {
    rule: FillRule,
    tree: Tree,
}

/// A search in three dimensions is faster, so normals are stored only where they count.
enum Tree {
    Places(RTree<GeomWithData<[f32; 3], Values>>),
    WithNormals(RTree<GeomWithData<[f32; 6], Values>>),
}

impl SeenCloud {
    /// Builds the tree of these points and values.
    pub fn new(rule: FillRule, seen: impl IntoIterator<Item = (SeenPoint, Values)>) -> Self {
        let seen = seen.into_iter();
        let tree = if rule.normal_weight_m > 0.0 {
            let point = |(seen, values): (SeenPoint, Values)| {
                GeomWithData::new(with_normal(rule, seen.place, seen.normal), values)
            };
            Tree::WithNormals(RTree::bulk_load(seen.map(point).collect()))
        } else {
            let point =
                |(seen, values): (SeenPoint, Values)| GeomWithData::new(seen.place.as_vec3().to_array(), values);
            Tree::Places(RTree::bulk_load(seen.map(point).collect()))
        };
        Self { rule, tree }
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        match &self.tree {
            Tree::Places(tree) => tree.size() == 0,
            Tree::WithNormals(tree) => tree.size() == 0,
        }
    }

    /// The values for a place of a surface with this normal; none without any points.
    pub fn values_at(&self, place: DVec3, normal: DVec3) -> Option<Values> {
        match &self.tree {
            Tree::Places(tree) => from_nearest(tree, place.as_vec3().to_array(), self.rule.neighbours),
            Tree::WithNormals(tree) => from_nearest(tree, with_normal(self.rule, place, normal), self.rule.neighbours),
        }
    }
}

fn with_normal(rule: FillRule, place: DVec3, normal: DVec3) -> [f32; 6] {
    // Opposite unit normals have distance 2.
    let (place, normal) = (place.as_vec3(), (normal * (rule.normal_weight_m / 2.0)).as_vec3());
    [place.x, place.y, place.z, normal.x, normal.y, normal.z]
}

fn from_nearest<P: rstar::Point<Scalar = f32>>(
    tree: &RTree<GeomWithData<P, Values>>,
    point: P,
    neighbours: NonZero<usize>,
) -> Option<Values> {
    if neighbours.get() == 1 {
        return tree.nearest_neighbor(&point).map(|nearest| nearest.data);
    }
    let (mut sum, mut weights) = ([0.0_f64; 5], 0.0);
    for (near, distance2) in tree.nearest_neighbor_iter_with_distance_2(&point).take(neighbours.get()) {
        // The bound keeps the weight finite at a seen point, whose values then outweigh all others.
        let weight = 1.0 / f64::from(distance2).max(1e-12);
        sum.iter_mut().zip(near.data).for_each(|(sum, value)| *sum += weight * f64::from(value));
        weights += weight;
    }
    (weights > 0.0).then(|| sum.map(|sum| (sum / weights) as f32))
}

/// Gives every unseen texel the values of the seen points nearest to it. Returns false where no point is seen.
pub fn fill(cloud: &SeenCloud, known: &mut PartialAtlas, mesh: &TriangleMesh) -> bool {
    if cloud.is_empty() {
        return false;
    }
    let PartialAtlas { atlas, texels } = known;
    let size = atlas.size();
    texels.pixels_mut().par_chunks_mut(size).enumerate().for_each(|(y, row)| {
        for (x, texel) in row.iter_mut().enumerate().filter(|(_, texel)| **texel == Texel::Unseen) {
            let Some((triangle, _)) = atlas.owner(x, y) else { continue };
            let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let place = place_of(atlas, mesh, triangle, centre);
            if let Some(values) = cloud.values_at(place, mesh.geometric_normal(triangle)) {
                *texel = Texel::Seen(values);
            }
        }
    });
    true
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_dataset::uv_atlas::UvAtlas;
    use mateval_image::Picture;
    use mateval_testkit::scenes::quad;

    use super::FillRule;
    use super::*;

    /// A wall of 2 m x 2 m along an axis; its uv are the unit square.
    fn wall() -> TriangleMesh {
        quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0)
    }

    /// The left third is seen; the values of a texel are its column and row.
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
        assert!(fill(&SeenCloud::new(rule, seen()), &mut known, &wall()));
        known
    }

    #[test]
    fn the_nearest_point_is_that_of_an_exhaustive_search() {
        for weight in [0.0, 0.3] {
            let (filled, all) = (filled(1, weight), seen());
            for (x, y) in (16..48).flat_map(|x| (0..48).map(move |y| (x, y))) {
                let centre = DVec3::new((x as f64 + 0.5) / 24.0, 2.0 - (y as f64 + 0.5) / 24.0, 0.0);
                let apart = |(point, _): &(SeenPoint, Values)| point.place.distance_squared(centre);
                let nearest = all.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
                assert_eq!(filled.texels.get(x, y), Texel::Seen(nearest.unwrap().1));
            }
        }
    }

    #[test]
    fn three_are_weighted_by_the_inverse_square() {
        let (filled, mut all) = (filled(3, 0.0), seen());
        for (x, y) in (16..48).flat_map(|x| (0..48).map(move |y| (x, y))) {
            let centre = DVec3::new((x as f64 + 0.5) / 24.0, 2.0 - (y as f64 + 0.5) / 24.0, 0.0);
            let apart = |(point, _): &(SeenPoint, Values)| point.place.distance_squared(centre);
            all.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
            let weights = [0, 1, 2].map(|at| 1.0 / apart(&all[at]));
            let mean = |c: usize| {
                let sum: f64 = all[..3].iter().zip(&weights).map(|((_, v), weight)| weight * f64::from(v[c])).sum();
                (sum / weights.iter().sum::<f64>()) as f32
            };
            let Texel::Seen(found) = filled.texels.get(x, y) else { panic!("not filled") };
            assert!((found[0] - mean(0)).abs() < 2e-3 && (found[1] - mean(1)).abs() < 2e-3, "{x} {y}: {found:?}");
        }
    }

    #[test]
    fn seen_texels_are_unchanged() {
        for neighbours in [1, 3] {
            let filled = filled(neighbours, 0.0);
            for (before, after) in known().texels.pixels().iter().zip(filled.texels.pixels()) {
                assert!(*before == Texel::Unseen || before == after);
                assert!(*after != Texel::Unseen);
            }
        }
    }

    #[test]
    fn without_points_nothing_is_filled() {
        assert!(!fill(&SeenCloud::new(FillRule::default(), []), &mut known(), &wall()));
        // Many points at one place.
        let (point, value) = seen()[0];
        let many = std::iter::repeat_n((point, value), 100_000);
        assert!(fill(&SeenCloud::new(FillRule::default(), many), &mut known(), &wall()));
    }
}
