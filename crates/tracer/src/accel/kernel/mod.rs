//! Eight boxes or eight triangles at once: one set of formulas, on AVX2 and on anything.
//!
//! Both kernels do the same roundings in the same order (fused multiply-adds included), so they give the same bits.
//!
//! **Boxes** are padded so that no triangle is lost that the triangle test would find. That test rounds the corners in the
//! ray's sheared space, which moves them by at most 6 * 2^-24 times their largest coordinate seen from the ray's origin
//! (one rounding each of x and z, two of the shear, |shear| <= 1, and one of a sum of up to twice them), and its distance
//! is that of the moved triangle to 10 roundings of its farthest corner (2 of the weights, 3 of the weighted sum, 2 of the
//! sum of weights, 3 of product, reciprocal and quotient). So a box padded by 16 * 2^-24 times (farthest corner of the
//! scene from the origin + the origin's own largest coordinate, for the rounding of the padded origins) holds the hit;
//! the slabs' own relative rounding is covered by widening the interval by 2^-21, as are the 10 again. The padding is the
//! same for the whole ray and is put into its origin: it costs nothing.
//!
//! **Triangles**, watertight: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013). Corners are moved
//! into the ray's own sheared space, where the ray is the z axis, and rounded there. The three edge functions a b - c d are
//! computed by Kahan's method with fused multiply-adds, whose relative error is below 2^-22 (Jeannerod, Louvet, Muller,
//! "Further analysis of Kahan's algorithm for the accurate computation of 2x2 determinants", 2013): so their signs are
//! exact, unless numbers below 3e-16 m are multiplied, and two triangles with a common edge agree about the side on which
//! the ray passes; around a common corner there is no gap.
//!
//! **Triangles**, fast: Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection" (1997). Rays may slip
//! through common edges.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod memory;
mod portable;
mod stack;

use super::wide::{Block, Node, WIDTH};
use crate::ray::Ray;

#[cfg(target_arch = "x86_64")]
pub(super) use avx2::Avx2;
pub(crate) use memory::{move_to_huge_pages, on_huge_pages, prefetch, prefetch_line};
pub(super) use portable::Portable;
pub(super) use stack::Stack;

/// Which of a node's boxes a ray meets.
pub(super) struct Boxes<L> {
    /// Bit k: child k.
    pub(super) met: u32,
    /// Where the ray enters each; meaningless for the others.
    pub(super) enter: L,
}

/// Which of a block's triangles a ray hits, and its place there; meaningless for the others.
pub(super) struct Triangles {
    /// Bit k: triangle k.
    pub(super) hit: u32,
    pub(super) distance: [f32; WIDTH],
    /// Weights of the corners, not yet divided by their sum.
    pub(super) weights: [[f32; WIDTH]; 3],
}

/// Eight lanes of arithmetic.
pub(super) trait Kernel: Copy {
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
fn key(distance: f32, child: u32) -> u32 {
    distance.to_bits() & !7 | child
}

/// What of a ray the box test needs.
pub(super) struct BoxRay {
    /// Which of a box's corners is nearer along each axis: 0 the lower, 1 the upper.
    near: [usize; 3],
    inverse: [f32; 3],
    /// The padded origins times the inverse directions.
    near_origin: [f32; 3],
    far_origin: [f32; 3],
}

const PADDING: f32 = 1.0 / (1 << 20) as f32;
/// How much farther a box may seem than what it holds.
pub(super) const WIDENED: f32 = 1.0 + 1.0 / (1 << 21) as f32;
/// Directions smaller than this count as this in the slab test: over a kilometre it moves the ray by 1e-17 m.
const SMALLEST_DIRECTION: f32 = 1e-20;

impl BoxRay {
    /// `scene_size` is the scene's largest coordinate.
    #[inline(always)]
    pub(super) fn new(ray: &Ray, scene_size: f32) -> Self {
        let origin = ray.origin().to_array();
        let pad = (scene_size + 2.0 * ray.origin().abs().max_element()) * PADDING;
        let mut slab = Self { near: [0; 3], inverse: [0.0; 3], near_origin: [0.0; 3], far_origin: [0.0; 3] };
        for (axis, d) in ray.direction().to_array().into_iter().enumerate() {
            let inverse = 1.0 / d.abs().max(SMALLEST_DIRECTION).copysign(d);
            let signed_pad = pad.copysign(d);
            slab.near[axis] = usize::from(d < 0.0);
            slab.inverse[axis] = inverse;
            slab.near_origin[axis] = (origin[axis] + signed_pad) * inverse;
            slab.far_origin[axis] = (origin[axis] - signed_pad) * inverse;
        }
        slab
    }
}

/// What of a ray the triangle tests need.
pub(super) struct TriangleRay {
    origin: [f32; 3],
    direction: [f32; 3],
    /// The axes x, y, z of the sheared space; z is where the direction is largest.
    axes: [usize; 3],
    shear: [f32; 2],
    /// One over the direction along z.
    distance_from_z: f32,
}

impl TriangleRay {
    #[inline(always)]
    pub(super) fn new(ray: &Ray, boxes: &BoxRay) -> Self {
        let d = ray.direction().to_array();
        let [along_x, along_y, along_z] = d.map(f32::abs);
        let z = if along_x > along_y.max(along_z) { 0 } else { 2 - usize::from(along_y > along_z) };
        let (x, y) = ([1, 2, 0][z], [2, 0, 1][z]);
        // The largest direction of a unit vector is not one that was raised to the smallest.
        let distance_from_z = boxes.inverse[z];
        Self {
            origin: ray.origin().to_array(),
            direction: d,
            axes: [x, y, z],
            shear: [d[x] * distance_from_z, d[y] * distance_from_z],
            distance_from_z,
        }
    }
}
