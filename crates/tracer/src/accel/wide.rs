//! The wide hierarchy that rays traverse, and how it is built: nodes of eight boxes, and blocks of up to eight
//! triangles as leaves. Only this file names obvhs.
//!
//! First a binary tree of boxes: PLOC (Meister and Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume
//! Hierarchy Construction", 2018), then parallel reinsertion (the same authors, 2017). Each leaf holds one triangle.
//!
//! Then dynamic programming over the surface area cost decides which nodes of the binary tree become children of one
//! wide node and which subtrees become one block (Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs
//! Through Compressed Wide BVHs", HPG 2017, section 4.1). About 90 bytes a triangle.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use rayon::prelude::*;

use super::kernel::{Block, Child, Node, WIDTH, on_huge_pages};

#[derive(Debug)]
pub(super) struct Wide {
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
    pub(super) root: Child,
}

impl Block {
    /// The corners of one triangle.
    pub(super) fn corners_of(&self, lane: usize) -> [Vec3; 3] {
        self.corners.map(|axes| Vec3::from_array(axes.map(|values| values[lane])))
    }

    fn new(triangles: &[[Vec3; 3]], starts: &[u32], members: &[u32]) -> Self {
        let nowhere = [triangles[members[0] as usize][0]; 3];
        let mut block = Self { corners: [[[0.0; WIDTH]; 3]; 3], triangles: [u32::MAX; WIDTH], surfaces: [0; WIDTH] };
        for lane in 0..WIDTH {
            let corners = members.get(lane).map_or(nowhere, |&triangle| triangles[triangle as usize]);
            for (axes, corner) in block.corners.iter_mut().zip(corners) {
                for (values, value) in axes.iter_mut().zip(corner.to_array()) {
                    values[lane] = value;
                }
            }
        }
        block.triangles[..members.len()].copy_from_slice(members);
        for (surface, triangle) in block.surfaces.iter_mut().zip(members) {
            *surface = (starts.partition_point(|start| start <= triangle) - 1) as u32;
        }
        block
    }
}

/// The cost of visiting a node, relative to that of visiting a block below.
const NODE_COST: f32 = 1.0;
const BLOCK_COST: f32 = 0.6;

/// The least cost of a subtree as children of the wide node above: entry k is for at most k + 1 children, for 1 to 7
/// children. The last entry is the number of triangles.
type Costs = [f32; WIDTH];

struct Collapse<'t> {
    tree: &'t BinaryTree,
    costs: Vec<Costs>,
}

impl Wide {
    /// Builds the hierarchy over at least one triangle with finite corners. `starts` holds the number of triangles
    /// before each surface.
    pub(super) fn build(triangles: &[[Vec3; 3]], starts: &[u32]) -> Self {
        let tree = &BinaryTree::build(triangles);
        let collapse = Collapse { tree, costs: costs(tree) };
        let (mut nodes, mut roots) = (Vec::new(), Vec::new());
        let root = collapse.child(0, &mut roots);
        // Wide nodes whose boxes are not filled in yet: the index in the binary tree and among `nodes`.
        let mut open = Vec::new();
        if !root.is_block() {
            nodes.push(EMPTY);
            open.push((0, 0));
        }
        while let Some((binary, place)) = open.pop() {
            let mut members = Members::default();
            collapse.expand(binary, WIDTH, &mut members);
            for (lane, &member) in members.places[..members.count].iter().enumerate() {
                let mut child = collapse.child(member, &mut roots);
                if !child.is_block() {
                    child = Child(nodes.len() as u32);
                    nodes.push(EMPTY);
                    open.push((member, child.place()));
                }
                nodes[place].put(lane, tree.bounds(member), child);
            }
        }
        let block = |&root: &usize| Block::new(triangles, starts, &triangles_below(tree, root));
        let blocks = roots.par_iter().map(block).collect();
        Self { nodes: on_huge_pages(nodes), blocks: on_huge_pages(blocks), root }
    }

    /// The memory that nodes and blocks take, in bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.blocks.len() * size_of::<Block>()
    }
}

const EMPTY: Node = Node { bounds: [[[0.0; WIDTH]; 3]; 2], children: [Child(0); WIDTH], filled: 0 };

impl Node {
    fn put(&mut self, lane: usize, bounds: [Vec3; 2], child: Child) {
        for (axes, corner) in self.bounds.iter_mut().zip(bounds) {
            for (values, value) in axes.iter_mut().zip(corner.to_array()) {
                values[lane] = value;
            }
        }
        self.children[lane] = child;
        self.filled |= 1 << lane;
    }
}

/// The nodes of the binary tree that become children of one wide node.
#[derive(Default)]
struct Members {
    places: [usize; WIDTH],
    count: usize,
}

impl Collapse<'_> {
    /// The child for a node of the binary tree: a block, whose root is added to `roots`, or a node whose index is not
    /// set yet.
    fn child(&self, node: usize, roots: &mut Vec<usize>) -> Child {
        if self.costs[node][WIDTH - 1] > WIDTH as f32 {
            return Child(0);
        }
        roots.push(node);
        Child((roots.len() - 1) as u32 | Child::BLOCK)
    }

    /// Splits `node` into up to `slots` children of least cost.
    fn expand(&self, node: usize, slots: usize, members: &mut Members) {
        let is_root = slots == WIDTH;
        match self.tree.node(node) {
            BinaryNode::Inner(children) if slots > 1 => {
                let (cheapest, left) = cheapest_split(&children.map(|child| self.costs[child]), slots);
                if is_root || cheapest < self.costs[node][slots - 2] {
                    self.expand(children[0], left, members);
                    self.expand(children[1], slots - left, members);
                } else {
                    self.expand(node, slots - 1, members);
                }
            }
            _ => {
                members.places[members.count] = node;
                members.count += 1;
            }
        }
    }
}

/// The costs of all nodes of the binary tree.
fn costs(tree: &BinaryTree) -> Vec<Costs> {
    let leaf = |node: usize| {
        let mut costs = [tree.half_area(node) * BLOCK_COST; WIDTH];
        costs[WIDTH - 1] = 1.0;
        costs
    };
    let mut costs: Vec<Costs> = (0..tree.len()).into_par_iter().map(leaf).collect();
    for node in tree.inner_nodes().into_iter().rev().map(|node| node as usize) {
        if let BinaryNode::Inner(children) = tree.node(node) {
            costs[node] = inner_costs(tree.half_area(node), &children.map(|child| costs[child]));
        }
    }
    costs
}

fn inner_costs(area: f32, children: &[Costs; 2]) -> Costs {
    // Counts are exact up to 8, which is all that matters.
    let count = children[0][WIDTH - 1] + children[1][WIDTH - 1];
    let mut costs = [0.0; WIDTH];
    costs[0] =
        if count <= WIDTH as f32 { area * BLOCK_COST } else { area * NODE_COST + cheapest_split(children, WIDTH).0 };
    for slots in 2..WIDTH {
        costs[slots - 1] = cheapest_split(children, slots).0.min(costs[slots - 2]);
    }
    costs[WIDTH - 1] = count;
    costs
}

/// The least cost of dividing `slots` slots between two subtrees, and the number of slots of the first.
#[inline]
fn cheapest_split(children: &[Costs; 2], slots: usize) -> (f32, usize) {
    let mut best = (f32::INFINITY, 1);
    for left in 1..slots {
        let cost = children[0][left - 1] + children[1][slots - left - 1];
        if cost < best.0 {
            best = (cost, left);
        }
    }
    best
}

/// The triangles below a node, in ascending order.
fn triangles_below(tree: &BinaryTree, root: usize) -> Vec<u32> {
    let (mut open, mut found) = (vec![root], Vec::with_capacity(WIDTH));
    while let Some(node) = open.pop() {
        match tree.node(node) {
            BinaryNode::Inner(children) => open.extend(children),
            BinaryNode::Leaf(triangle) => found.push(triangle),
        }
    }
    found.sort_unstable();
    found
}

/// A binary tree over triangles. Node 0 is its root.
struct BinaryTree(Bvh2);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BinaryNode {
    /// The indices of two child nodes.
    Inner([usize; 2]),
    Leaf(u32),
}

impl BinaryTree {
    /// Builds the tree over at least one triangle with finite corners.
    fn build(triangles: &[[Vec3; 3]]) -> Self {
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
    fn inner_nodes(&self) -> Vec<u32> {
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

    fn len(&self) -> usize {
        self.0.nodes.len()
    }

    #[inline]
    fn node(&self, node: usize) -> BinaryNode {
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
    fn bounds(&self, node: usize) -> [Vec3; 2] {
        let Aabb { min, max } = self.0.nodes[node].aabb;
        [min.into(), max.into()]
    }

    /// Half the surface area of a node's box.
    #[inline]
    fn half_area(&self, node: usize) -> f32 {
        self.0.nodes[node].aabb.half_area()
    }
}
