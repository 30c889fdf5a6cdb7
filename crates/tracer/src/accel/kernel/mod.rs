//! Tests eight boxes or eight triangles at once: the same formulas in an AVX2 kernel and in a portable one.
//!
//! Both kernels round in the same places and in the same order (fused multiply-adds included), so they compute the same
//! bits.
//!
//! **Boxes** are padded so that no triangle is lost that the triangle test would hit. That test rounds the corners in
//! the ray's sheared space, which moves them by at most 6 * 2^-24 times their largest coordinate relative to the ray's
//! origin: one rounding each of x and z, two of the shear (|shear| <= 1), and one of a sum of up to twice them. The
//! distance it computes is that of the moved triangle up to 10 roundings of its farthest corner: 2 of the weights, 3 of
//! the weighted sum, 2 of the sum of weights, 3 of product, reciprocal and quotient.
//!
//! A box therefore contains the hit if it is padded by 16 * 2^-24 times the sum of two lengths: the farthest corner of
//! the scene from the origin, and the origin's own largest coordinate, for the rounding of the padded origins. Widening
//! the interval by 2^-21 covers the relative rounding of the slab test and the 10 roundings of the distance. The
//! padding is the same for the whole ray and is added to its origin, so it costs nothing.
//!
//! **Triangles**, watertight: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013). Corners are
//! moved into the ray's own sheared space, where the ray is the z axis, and rounded there. The three edge functions
//! a b - c d are computed by Kahan's method with fused multiply-adds, whose relative error is below 2^-22 (Jeannerod,
//! Louvet, Muller, "Further analysis of Kahan's algorithm for the accurate computation of 2x2 determinants", 2013).
//! Their signs are therefore exact unless numbers below 3e-16 m are multiplied, so two triangles that share an edge
//! agree on which side of it the ray passes, and around a shared corner there is no gap.
//!
//! **Triangles**, fast: Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection" (1997). Rays may slip
//! through shared edges.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod lanes;
mod memory;
mod portable;
mod stack;
mod test_ray;

#[cfg(target_arch = "x86_64")]
pub(super) use avx2::Avx2;
pub(super) use lanes::{Boxes, Kernel, Triangles};
pub(crate) use memory::{move_to_huge_pages, on_huge_pages, prefetch, prefetch_line};
pub(super) use portable::Portable;
pub(super) use stack::Stack;
pub(super) use test_ray::{BoxRay, TriangleRay};
