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
//! **Triangles**: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013). Corners are
//! moved into the ray's own sheared space, where the ray is the z axis, and rounded there. The three edge functions
//! a b - c d are computed by Kahan's method with fused multiply-adds, whose relative error is below 2^-22 (Jeannerod,
//! Louvet, Muller, "Further analysis of Kahan's algorithm for the accurate computation of 2x2 determinants", 2013).
//! Their signs are therefore exact unless numbers below 3e-16 m are multiplied, so two triangles that share an edge
//! agree on which side of it the ray passes, and around a shared corner there is no gap.
#![allow(
    unsafe_code,
    reason = "processor instructions, calls of the system, and a stack that is not cleared for each ray"
)]

#[cfg(target_arch = "x86_64")]
mod avx2;

use std::mem::MaybeUninit;

use crate::ray::Ray;
#[cfg(target_arch = "x86_64")]
pub(super) use avx2::Avx2;

/// The number of boxes in a node and of triangles in a block.
pub(super) const WIDTH: usize = 8;

/// Eight boxes and their children: four cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Lower corners in `bounds[0]`, upper corners in `bounds[1]`; indexed by axis, then child.
    pub(super) bounds: [[[f32; WIDTH]; 3]; 2],
    pub(super) children: [Child; WIDTH],
    /// Bit k is set if child k exists.
    pub(super) filled: u32,
}

/// Up to eight triangles: 352 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Block {
    /// Indexed by corner, axis, triangle. Triangles ascend. Unused lanes hold one point three times, which no ray hits.
    pub(super) corners: [[[f32; WIDTH]; 3]; 3],
    pub(super) triangles: [u32; WIDTH],
    pub(super) surfaces: [u32; WIDTH],
}

/// The index of a node, or the index of a block with the highest bit set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(super) struct Child(pub(super) u32);

impl Child {
    pub(super) const BLOCK: u32 = 1 << 31;

    #[inline(always)]
    pub(super) fn is_block(self) -> bool {
        self.0 & Self::BLOCK != 0
    }

    /// The index among nodes or among blocks.
    #[inline(always)]
    pub(super) fn place(self) -> usize {
        (self.0 & !Self::BLOCK) as usize
    }
}

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
    fn triangles(self, block: &Block, ray: &TriangleRay, limit: f32) -> Triangles;
}

/// A sort key. The bits of distances that are not negative sort like the distances; the child's lane takes the last
/// three bits.
#[inline(always)]
pub(super) fn key(distance: f32, child: u32) -> u32 {
    distance.to_bits() & !7 | child
}

/// The values of a ray for the box test.
pub(crate) struct BoxRay {
    /// For each axis, which corner of a box is nearer: 0 the lower, 1 the upper.
    pub(super) near: [usize; 3],
    pub(super) inverse: [f32; 3],
    /// The padded origins times the inverse directions.
    pub(super) near_origin: [f32; 3],
    pub(super) far_origin: [f32; 3],
}

const PADDING: f32 = 1.0 / (1 << 20) as f32;
/// The factor by which the interval of a box test is widened.
pub(crate) const WIDENED: f32 = 1.0 + 1.0 / (1 << 21) as f32;
/// Smaller direction components are raised to this in the slab test: over a kilometre that moves the ray by 1e-17 m.
const SMALLEST_DIRECTION: f32 = 1e-20;

impl BoxRay {
    /// `scene_size` is the largest absolute coordinate of the scene.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, scene_size: f32) -> Self {
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

/// The values of a ray for the triangle test.
pub(crate) struct TriangleRay {
    pub(super) origin: [f32; 3],
    /// The axes that become x, y, z of the sheared space; z is the axis along which the direction is largest.
    pub(super) axes: [usize; 3],
    pub(super) shear: [f32; 2],
    /// One over the direction's component along z.
    pub(super) distance_from_z: f32,
}

impl TriangleRay {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, boxes: &BoxRay) -> Self {
        let d = ray.direction().to_array();
        let [along_x, along_y, along_z] = d.map(f32::abs);
        let z = if along_x > along_y.max(along_z) { 0 } else { 2 - usize::from(along_y > along_z) };
        let (x, y) = ([1, 2, 0][z], [2, 0, 1][z]);
        // The largest component of a unit vector is never below `SMALLEST_DIRECTION`.
        let distance_from_z = boxes.inverse[z];
        Self {
            origin: ray.origin().to_array(),
            axes: [x, y, z],
            shear: [d[x] * distance_from_z, d[y] * distance_from_z],
            distance_from_z,
        }
    }
}

/// A kernel that every processor can run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

/// A hit of one triangle: distance, and the weights of its corners, not yet divided by their sum.
struct LaneHit {
    distance: f32,
    weights: [f32; 3],
}

impl Kernel for Portable {
    type Lanes = [f32; WIDTH];

    fn boxes(self, node: &Node, ray: &BoxRay, limit: f32) -> Boxes<Self::Lanes> {
        let mut boxes = Boxes { met: 0, enter: [0.0; WIDTH] };
        for lane in 0..WIDTH {
            let (mut enter, mut leave) = (0.0_f32, limit);
            for axis in 0..3 {
                let (nearer, farther) = (ray.near[axis], 1 - ray.near[axis]);
                let near = node.bounds[nearer][axis][lane].mul_add(ray.inverse[axis], -ray.near_origin[axis]);
                let far = node.bounds[farther][axis][lane].mul_add(ray.inverse[axis], -ray.far_origin[axis]);
                enter = if near > enter { near } else { enter };
                leave = if far < leave { far } else { leave };
            }
            boxes.met |= u32::from(enter <= leave * WIDENED) << lane;
            boxes.enter[lane] = enter;
        }
        boxes.met &= node.filled;
        boxes
    }

    fn push_sorted(self, node: &Node, boxes: &Boxes<Self::Lanes>, stack: &mut Stack) {
        let mut keys = [0; WIDTH];
        let mut count = 0;
        for lane in (0..WIDTH).filter(|lane| boxes.met & (1 << lane) != 0) {
            keys[count] = key(boxes.enter[lane], lane as u32);
            count += 1;
        }
        keys[..count].sort_unstable_by(|a, b| b.cmp(a));
        for key in &keys[..count] {
            stack.push(key & !7, node.children[(key & 7) as usize]);
        }
    }

    fn triangles(self, block: &Block, ray: &TriangleRay, limit: f32) -> Triangles {
        let mut found = Triangles { hit: 0, distance: [0.0; WIDTH], weights: [[0.0; WIDTH]; 3] };
        for lane in 0..WIDTH {
            let corners = block.corners.map(|axes| axes.map(|values| values[lane]));
            let hit = watertight(&corners, ray);
            let Some(hit) = hit.filter(|hit| hit.distance > 0.0 && hit.distance <= limit) else { continue };
            found.hit |= 1 << lane;
            found.distance[lane] = hit.distance;
            for (values, weight) in found.weights.iter_mut().zip(hit.weights) {
                values[lane] = weight;
            }
        }
        found
    }
}

fn watertight(corners: &[[f32; 3]; 3], ray: &TriangleRay) -> Option<LaneHit> {
    let [a, b, c] = corners.map(|corner| {
        let [x, y, z] = ray.axes.map(|axis| corner[axis] - ray.origin[axis]);
        [(-ray.shear[0]).mul_add(z, x), (-ray.shear[1]).mul_add(z, y), z]
    });
    let (u, v, w) = (difference(c, b), difference(a, c), difference(b, a));
    let (all_above, all_below) = (u >= 0.0 && v >= 0.0 && w >= 0.0, u <= 0.0 && v <= 0.0 && w <= 0.0);
    let sum = (u + v) + w;
    if !(all_above || all_below) || sum == 0.0 {
        return None;
    }
    let z = w.mul_add(c[2], v.mul_add(b[2], u * a[2]));
    Some(LaneHit { distance: z * ray.distance_from_z / sum, weights: [u, v, w] })
}

/// p.x q.y - p.y q.x by Kahan's method; its sign is exact.
fn difference(p: [f32; 3], q: [f32; 3]) -> f32 {
    let product = p[1] * q[0];
    let lost = (-p[1]).mul_add(q[0], product);
    p[0].mul_add(q[1], -product) + lost
}

/// The nodes and blocks that a ray has yet to visit, with the bits of the distance at which the ray enters them. Fixed
/// arrays, and a vector for entries beyond them.
pub(crate) struct Stack {
    /// The first `len` entries of both arrays have been written.
    enters: [MaybeUninit<u32>; FIXED],
    children: [MaybeUninit<Child>; FIXED],
    len: usize,
    spilled: Vec<(u32, Child)>,
}

/// Small in tests, so that tests reach the vector.
const FIXED: usize = if cfg!(test) { 12 } else { 128 };

impl Stack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            enters: [const { MaybeUninit::uninit() }; FIXED],
            children: [const { MaybeUninit::uninit() }; FIXED],
            len: 0,
            spilled: Vec::new(),
        }
    }

    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.len = 0;
        self.spilled.clear();
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, enter_bits: u32, child: Child) {
        if self.len < FIXED {
            self.enters[self.len].write(enter_bits);
            self.children[self.len].write(child);
            self.len += 1;
        } else {
            self.spill(enter_bits, child);
        }
    }

    /// The next eight free entries of the arrays, to be written before [`Self::commit`]; `None` if fewer are free.
    #[inline(always)]
    pub(super) fn free_slots(&mut self) -> Option<FreeSlots<'_>> {
        let enters = self.enters.get_mut(self.len..)?.first_chunk_mut()?;
        let children = self.children.get_mut(self.len..)?.first_chunk_mut()?;
        Some(FreeSlots { enters, children })
    }

    /// Adds the first `count` entries (at most eight) of [`Self::free_slots`] to the stack.
    ///
    /// # Safety
    ///
    /// [`Self::free_slots`] has returned slots, and the first `count` of them have been written since the last push.
    #[inline(always)]
    pub(super) unsafe fn commit(&mut self, count: usize) {
        self.len += count;
    }

    #[cold]
    #[inline(never)]
    fn spill(&mut self, enter_bits: u32, child: Child) {
        self.spilled.push((enter_bits, child));
    }

    #[cold]
    #[inline(never)]
    fn unspill(&mut self) -> Option<(u32, Child)> {
        self.spilled.pop()
    }

    /// The last child in the arrays, to prefetch its memory.
    #[inline(always)]
    pub(crate) fn top(&self) -> Option<Child> {
        let last = self.len.checked_sub(1)?;
        // SAFETY: every entry below `len` has been written, as shown in `pop`.
        Some(unsafe { self.children[last].assume_init() })
    }

    /// Pops children until one is found that the ray enters before `limit`.
    #[inline(always)]
    pub(crate) fn pop(&mut self, limit: f32) -> Option<Child> {
        loop {
            let (enter_bits, child) = if self.len == FIXED && !self.spilled.is_empty() {
                self.unspill()?
            } else {
                self.len = self.len.checked_sub(1)?;
                // SAFETY: `len` grows only after the entries it then includes have been written: one in `push`, `count`
                // before `commit`. So every entry below the old `len` has been written.
                unsafe { (self.enters[self.len].assume_init(), self.children[self.len].assume_init()) }
            };
            if f32::from_bits(enter_bits) <= limit * WIDENED {
                return Some(child);
            }
        }
    }
}

/// The next eight free entries of a stack.
pub(super) struct FreeSlots<'s> {
    pub(super) enters: &'s mut [MaybeUninit<u32>; WIDTH],
    pub(super) children: &'s mut [MaybeUninit<Child>; WIDTH],
}

/// Bytes of a cache line. Prefetching and huge pages are hints: results do not depend on them.
const LINE: usize = 64;

/// Prefetches the cache lines of the value at `place`.
#[inline(always)]
pub(crate) fn prefetch<T>(place: &T) {
    let start = std::ptr::from_ref(place).cast::<u8>();
    for line in 0..size_of::<T>().div_ceil(LINE) {
        prefetch_line(start.wrapping_add(LINE * line));
    }
}

/// Prefetches the cache line that holds `address`, which may be any address: the program reads nothing from it.
#[inline(always)]
pub(crate) fn prefetch_line(address: *const u8) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: every x86-64 processor has the instruction, and it never faults, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast::<i8>()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// Copies values to memory for which the system has been asked to use huge pages, where it has them. Rays access more
/// memory at random than the processor can keep small-page addresses for.
pub(crate) fn on_huge_pages<T: Copy>(values: Vec<T>) -> Vec<T> {
    let mut moved = Vec::with_capacity(values.len());
    ask_for_huge_pages(moved.spare_capacity_mut());
    moved.extend_from_slice(&values);
    moved
}

/// The system accepts whole pages only. On processors with larger pages it refuses.
#[cfg(target_os = "linux")]
const PAGE: usize = 4096;

/// Only changes how memory is mapped; a refusal costs nothing but time.
#[cfg(target_os = "linux")]
fn ask_for_huge_pages<T>(memory: &mut [MaybeUninit<T>]) {
    let start = memory.as_mut_ptr().cast::<libc::c_void>();
    let skipped = start.align_offset(PAGE);
    let length = size_of_val(memory).saturating_sub(skipped) / PAGE * PAGE;
    if length > 0 {
        // SAFETY: the range is whole pages within our own memory, and the advice does not change their contents.
        unsafe { libc::madvise(start.wrapping_byte_add(skipped), length, libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn ask_for_huge_pages<T>(_: &mut [MaybeUninit<T>]) {}

/// Asks the system to move `values` to huge pages now, at unchanged addresses. Many textures are smaller than a huge
/// page, so the range extends beyond both ends and neighbouring memory moves too, unnoticed by its owners.
#[cfg(target_os = "linux")]
pub(crate) fn move_to_huge_pages(values: &[u8]) {
    const HUGE_PAGE: usize = 512 * PAGE;
    /// Since Linux 6.1; older ones refuse.
    const MADV_COLLAPSE: libc::c_int = 25;
    let range = values.as_ptr_range();
    let start = range.start.addr() / HUGE_PAGE * HUGE_PAGE;
    let length = range.end.addr().next_multiple_of(HUGE_PAGE) - start;
    for advice in [libc::MADV_HUGEPAGE, MADV_COLLAPSE] {
        // SAFETY: neither advice changes the contents of memory or the permission to access it; for memory that is not
        // mapped the system only refuses.
        unsafe { libc::madvise(std::ptr::without_provenance_mut(start), length, advice) };
    }
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn move_to_huge_pages(_: &[u8]) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_in_is_the_first_out_however_many() {
        let mut stack = Stack::new();
        let count = 3 * FIXED as u32;
        for k in 0..count {
            stack.push((k as f32).to_bits(), Child(k));
        }
        for k in (0..count).rev() {
            assert_eq!(stack.pop(f32::INFINITY), Some(Child(k)));
        }
        assert_eq!(stack.pop(f32::INFINITY), None);
        stack.push(2.0_f32.to_bits(), Child(7));
        stack.push(5.0_f32.to_bits(), Child(8));
        assert_eq!(stack.pop(3.0), Some(Child(7)));
    }

    /// Buffers from one byte to more than a huge page keep their contents, and so do their neighbours.
    #[test]
    fn what_moves_stays_the_same() {
        let filled = |length: usize| (0..length).map(|k| (k % 251) as u8).collect::<Vec<u8>>();
        let lengths = [1, 5000, 700_000, 3_000_000];
        let pieces = lengths.map(filled);
        pieces.iter().for_each(|piece| move_to_huge_pages(piece));
        assert_eq!(pieces, lengths.map(filled));
        assert_eq!(on_huge_pages(filled(3_000_000)), filled(3_000_000));
    }
}
