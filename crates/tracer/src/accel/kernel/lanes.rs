//! What a kernel computes: eight boxes or eight triangles against one ray.

use super::stack::Stack;
use super::test_ray::{BoxRay, TriangleRay};
use crate::accel::wide::{Block, Node, WIDTH};

/// Which of a node's boxes a ray meets.
pub(crate) struct Boxes<L> {
    /// Bit k: child k.
    pub(crate) met: u32,
    /// Where the ray enters each; meaningless for the others.
    pub(crate) enter: L,
}

/// Which of a block's triangles a ray hits, and its place there; meaningless for the others.
pub(crate) struct Triangles {
    /// Bit k: triangle k.
    pub(crate) hit: u32,
    pub(crate) distance: [f32; WIDTH],
    /// Weights of the corners, not yet divided by their sum.
    pub(crate) weights: [[f32; WIDTH]; 3],
}

/// Eight lanes of arithmetic.
pub(crate) trait Kernel: Copy {
    type Lanes: Copy;

    fn boxes(self, node: &Node, ray: &BoxRay, limit: f32) -> Boxes<Self::Lanes>;

    /// Pushes the children met, if any, the farthest first; distances may lose their last three
    /// bits.
    fn push_sorted(self, node: &Node, boxes: &Boxes<Self::Lanes>, stack: &mut Stack);

    /// Triangles at a distance above 0 and up to `limit`; none of those seen edge-on.
    fn triangles<const WATERTIGHT: bool>(self, block: &Block, ray: &TriangleRay, limit: f32) -> Triangles;
}

/// Distances are not negative, so their bits are ordered as they are; the last three give way to the child's number.
#[inline(always)]
pub(super) fn key(distance: f32, child: u32) -> u32 {
    distance.to_bits() & !7 | child
}
