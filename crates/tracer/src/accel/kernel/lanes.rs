//! The interface of a kernel: eight boxes or eight triangles against one ray.

use super::stack::Stack;
use super::test_ray::{BoxRay, TriangleRay};
use crate::accel::wide::{Block, Node, WIDTH};

/// The boxes of a node that a ray meets.
pub(crate) struct Boxes<L> {
    /// Bit k: child k is met.
    pub(crate) met: u32,
    /// The distance at which the ray enters each box met; the values of other lanes are meaningless.
    pub(crate) enter: L,
}

/// The triangles of a block that a ray hits; the values of lanes without a hit are meaningless.
pub(crate) struct Triangles {
    /// Bit k: triangle k is hit.
    pub(crate) hit: u32,
    pub(crate) distance: [f32; WIDTH],
    /// Weights of the corners, not yet divided by their sum.
    pub(crate) weights: [[f32; WIDTH]; 3],
}

/// Arithmetic on eight lanes.
pub(crate) trait Kernel: Copy {
    type Lanes: Copy;

    fn boxes(self, node: &Node, ray: &BoxRay, limit: f32) -> Boxes<Self::Lanes>;

    /// Pushes the children met, if any, the farthest first. Distances may lose their last three bits.
    fn push_sorted(self, node: &Node, boxes: &Boxes<Self::Lanes>, stack: &mut Stack);

    /// Hits at a distance above 0 and at most `limit`. Triangles seen edge-on are not hit.
    fn triangles<const WATERTIGHT: bool>(self, block: &Block, ray: &TriangleRay, limit: f32) -> Triangles;
}

/// A sort key. The bits of distances that are not negative sort like the distances; the child's lane takes the last
/// three bits.
#[inline(always)]
pub(super) fn key(distance: f32, child: u32) -> u32 {
    distance.to_bits() & !7 | child
}
