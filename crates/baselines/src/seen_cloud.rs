//! What the pixels of an estimate show, as points in space (the paper's partial point cloud), to be found by place.
//!
//! By an R*-tree, not a k-d tree: what a view shows of a room is flat pieces, and from a place above such a piece a k-d
//! tree, which knows planes and no boxes, looks through all that lies as near sideways (`benches/lifting.rs`).

use std::num::NonZero;

use glam::DVec3;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use crate::estimate::Values;
use crate::seen::SeenPoint;

/// How an unseen texel follows from seen ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillRule {
    /// 1: the nearest (the paper); more: their mean, weighted by the inverse square of the distance (Point-UV Diffusion
    /// takes 3).
    pub neighbours: NonZero<usize>,
    /// Metres that opposite normals count as (normals at right angles 0.71 of it); 0: normals do not count.
    pub normal_weight_m: f64,
}

impl Default for FillRule {
    fn default() -> Self {
        Self { neighbours: NonZero::<usize>::MIN, normal_weight_m: 0.0 }
    }
}

/// Points of an estimate's pixels, with what it says of each.
pub struct SeenCloud {
    rule: FillRule,
    tree: Tree,
}

/// Three axes are faster: normals are left out where they do not count.
enum Tree {
    Places(RTree<GeomWithData<[f32; 3], Values>>),
    WithNormals(RTree<GeomWithData<[f32; 6], Values>>),
}

impl SeenCloud {
    /// Takes in points and what the estimate says of each.
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

    /// Whether nothing is seen.
    pub fn is_empty(&self) -> bool {
        match &self.tree {
            Tree::Places(tree) => tree.size() == 0,
            Tree::WithNormals(tree) => tree.size() == 0,
        }
    }

    /// What follows for a place of a surface with this normal; none where nothing is seen.
    pub fn values_at(&self, place: DVec3, normal: DVec3) -> Option<Values> {
        match &self.tree {
            Tree::Places(tree) => from_nearest(tree, place.as_vec3().to_array(), self.rule.neighbours),
            Tree::WithNormals(tree) => from_nearest(tree, with_normal(self.rule, place, normal), self.rule.neighbours),
        }
    }
}

fn with_normal(rule: FillRule, place: DVec3, normal: DVec3) -> [f32; 6] {
    // Opposite unit normals lie two apart.
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
        // At a seen point itself that one outweighs all others.
        let weight = 1.0 / f64::from(distance2).max(1e-12);
        sum.iter_mut().zip(near.data).for_each(|(sum, value)| *sum += weight * f64::from(value));
        weights += weight;
    }
    (weights > 0.0).then(|| sum.map(|sum| (sum / weights) as f32))
}
