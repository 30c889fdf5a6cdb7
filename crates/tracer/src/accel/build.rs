//! Builds the hierarchy: the one place that names obvhs.
//!
//! obvhs makes a binary tree (PLOC, Meister and Bittner 2018, with parallel reinsertion, 2017, and leaves collapsed by
//! the surface area heuristic); it is copied into nodes that hold the boxes of both their children.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;

/// The boxes of two children, and where they are: 64 bytes, one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// `bounds[child][0]` is the box's lower corner, `[1]` its upper.
    pub(super) bounds: [[[f32; 3]; 2]; 2],
    pub(super) children: [Child; 2],
}

/// An inner node (`count` 0, `first` its place) or a leaf of `count` triangles from `first` on.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Child {
    pub(super) first: u32,
    pub(super) count: u32,
}

/// The tree and the order of triangles in its leaves.
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    pub(super) root: Child,
    pub(super) bounds: [[f32; 3]; 2],
    /// Indices into the triangles given, leaf by leaf.
    pub(super) order: Vec<u32>,
}

/// Triangles in a leaf, at most.
const LARGEST_LEAF: u32 = 4;
/// What visiting a node costs, in triangle tests: ours, in f64, is no cheaper than a pair of boxes.
const NODE_COST: f32 = 1.0;

/// Builds over at least one triangle with finite corners.
pub(super) fn build(triangles: &[[Vec3; 3]]) -> Tree {
    let boxes: Vec<Aabb> = triangles.iter().map(|corners| Aabb::from_points(&corners.map(Vec3A::from))).collect();
    let tree = binary_tree(&boxes);
    let mut nodes = Vec::new();
    let root = copy(&tree, &mut nodes);
    Tree { nodes, root, bounds: corners(&tree.nodes[0].aabb), order: tree.primitive_indices }
}

fn binary_tree(boxes: &[Aabb]) -> Bvh2 {
    let params = BvhBuildParams::medium_build();
    let indices = (0..boxes.len() as u32).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        boxes,
        indices,
        params.sort_precision,
        params.search_depth_threshold,
    );
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut tree, params.reinsertion_batch_ratio, None);
    collapse(&mut tree, LARGEST_LEAF, NODE_COST);
    let second = params.reinsertion_batch_ratio * params.post_collapse_reinsertion_batch_ratio_multiplier;
    optimizer.run(&mut tree, second, None);
    tree
}

/// Copies the tree depth first with a stack of its own: the depth is not bounded.
fn copy(tree: &Bvh2, nodes: &mut Vec<Node>) -> Child {
    let source = &tree.nodes[0];
    if source.prim_count > 0 {
        return Child { first: source.first_index, count: source.prim_count };
    }
    // (first of the pair of children in obvhs' tree, the node of ours that describes the pair)
    let mut open = vec![(source.first_index as usize, push_empty(nodes))];
    while let Some((pair, place)) = open.pop() {
        for child in 0..2 {
            let source = &tree.nodes[pair + child];
            nodes[place].bounds[child] = corners(&source.aabb);
            let first = if source.prim_count > 0 {
                source.first_index
            } else {
                let place = push_empty(nodes);
                open.push((source.first_index as usize, place));
                place as u32
            };
            nodes[place].children[child] = Child { first, count: source.prim_count };
        }
    }
    Child { first: 0, count: 0 }
}

fn push_empty(nodes: &mut Vec<Node>) -> usize {
    nodes.push(Node { bounds: [[[0.0; 3]; 2]; 2], children: [Child { first: 0, count: 0 }; 2] });
    nodes.len() - 1
}

fn corners(aabb: &Aabb) -> [[f32; 3]; 2] {
    [aabb.min.to_array(), aabb.max.to_array()]
}
