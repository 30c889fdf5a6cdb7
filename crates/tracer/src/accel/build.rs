//! Builds the binary tree of boxes. Only this file names obvhs.
//!
//! PLOC (Meister and Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", 2018),
//! then parallel reinsertion (the same authors, 2017). Each leaf holds one triangle; `wide` decides which triangles
//! share a block.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use rayon::prelude::*;

/// A binary tree over triangles. Node 0 is its root.
pub(super) struct BinaryTree(Bvh2);

/// The contents of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BinaryNode {
    /// The indices of two child nodes.
    Inner([usize; 2]),
    /// The index of a triangle.
    Leaf(u32),
}

impl BinaryTree {
    /// Builds the tree over at least one triangle with finite corners.
    pub(super) fn build(triangles: &[[Vec3; 3]]) -> Self {
        let boxes: Vec<Aabb> =
            triangles.par_iter().map(|corners| Aabb::from_points(&corners.map(Vec3A::from))).collect();
        let params = BvhBuildParams::medium_build();
        let indices = (0..boxes.len() as u32).collect();
        let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
            params.ploc_search_distance,
            &boxes,
            indices,
            params.sort_precision,
            params.search_depth_threshold,
        );
        ReinsertionOptimizer::default().run(&mut tree, params.reinsertion_batch_ratio, None);
        Self(tree)
    }

    /// All inner nodes, parents before their children.
    pub(super) fn inner_nodes(&self) -> Vec<u32> {
        let mut found = Vec::with_capacity(self.0.nodes.len() / 2);
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            if let BinaryNode::Inner([left, right]) = self.node(node) {
                found.push(node as u32);
                open.extend([right, left]);
            }
        }
        found
    }

    /// The number of nodes.
    pub(super) fn len(&self) -> usize {
        self.0.nodes.len()
    }

    /// The contents of `node`.
    #[inline]
    pub(super) fn node(&self, node: usize) -> BinaryNode {
        let found = &self.0.nodes[node];
        let first = found.first_index as usize;
        if found.is_leaf() {
            BinaryNode::Leaf(self.0.primitive_indices[first])
        } else {
            BinaryNode::Inner([first, first + 1])
        }
    }

    /// The lower and the upper corner of a node's box.
    #[inline]
    pub(super) fn bounds(&self, node: usize) -> [Vec3; 2] {
        let Aabb { min, max } = self.0.nodes[node].aabb;
        [min.into(), max.into()]
    }

    /// Half the surface area of a node's box.
    #[inline]
    pub(super) fn half_area(&self, node: usize) -> f32 {
        self.0.nodes[node].aabb.half_area()
    }
}
