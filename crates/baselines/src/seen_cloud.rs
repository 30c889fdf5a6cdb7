//! The pixels of an estimate as points in space (the paper's partial point cloud), with nearest-point queries.
//!
//! The tree is an R*-tree and not a k-d tree: a view shows flat pieces of a room, and for a query above such a piece a
//! k-d tree, which bounds points by planes and not by boxes, visits many points beside it (`benches/lifting.rs`).

use std::num::NonZero;

use glam::DVec3;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use crate::estimate::Values;
use crate::seen::SeenPoint;

/// How the values of an unseen texel are computed from seen points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillRule {
    /// Number of nearest points: 1 in the paper. Several are averaged with the inverse square of the distance as weight;
    /// Point-UV Diffusion uses 3.
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
