//! Walks a ray through the hierarchy.
//!
//! Boxes are padded so that no triangle is lost that the triangle test would find. That test rounds the corners in the
//! ray's sheared space, which moves them by at most 6 * 2^-24 times their largest coordinate seen from the ray's origin
//! (two roundings each for the difference, the product and the sum, |shear| <= 1), and its distance is that of the moved
//! triangle to f64 accuracy. So a box padded by 16 * 2^-24 times (farthest corner of the scene from the origin + the
//! origin's own largest coordinate, for the rounding of the padded origins) holds the hit; the slabs' own relative
//! rounding is covered by widening the interval by 2^-21. The padding is the same for the whole ray and is put into its
//! origin: it costs nothing.

use super::build::{Child, Node};
use super::{Accel, Hit};
use crate::ray::Ray;

use super::triangle::ShearedRay;

const PADDING: f32 = 1.0 / (1 << 20) as f32;
const WIDENED: f32 = 1.0 + 1.0 / (1 << 21) as f32;
/// Directions smaller than this count as this in the slab test: over a kilometre it moves the ray by 1e-17 m.
const SMALLEST_DIRECTION: f32 = 1e-20;

struct SlabRay {
    /// Which of a box's corners is nearer along each axis: 0 the lower, 1 the upper.
    near: [usize; 3],
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    inverse: [f32; 3],
}

impl SlabRay {
    fn new(ray: &Ray, bounds: &[[f32; 3]; 2]) -> Self {
        let origin = ray.origin().to_array();
        let mut reach = 0.0_f32;
        for ((low, high), at) in bounds[0].iter().zip(bounds[1]).zip(origin) {
            let farthest = (low - at).abs().max((high - at).abs());
            reach = reach.max(farthest + at.abs());
        }
        let pad = reach * PADDING;
        let mut slab = Self { near: [0; 3], near_origin: origin, far_origin: origin, inverse: [0.0; 3] };
        for (axis, &d) in ray.direction().to_array().iter().enumerate() {
            let backwards = d < 0.0;
            let signed_pad = if backwards { -pad } else { pad };
            slab.near[axis] = usize::from(backwards);
            slab.near_origin[axis] = origin[axis] + signed_pad;
            slab.far_origin[axis] = origin[axis] - signed_pad;
            slab.inverse[axis] = 1.0 / d.abs().max(SMALLEST_DIRECTION).copysign(d);
        }
        slab
    }

    /// The distance at which the ray enters the box, if it does before `max_distance`.
    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "five arrays of three are indexed alike")]
    fn enter(&self, bounds: &[[f32; 3]; 2], max_distance: f32) -> Option<f32> {
        let (mut enter, mut leave) = (0.0_f32, max_distance);
        for axis in 0..3 {
            // `& 1` shows the compiler that both indices are in range.
            let (nearer, farther) = (self.near[axis] & 1, 1 ^ (self.near[axis] & 1));
            let near = (bounds[nearer][axis] - self.near_origin[axis]) * self.inverse[axis];
            let far = (bounds[farther][axis] - self.far_origin[axis]) * self.inverse[axis];
            enter = if near > enter { near } else { enter };
            leave = if far < leave { far } else { leave };
        }
        (enter <= leave * WIDENED).then_some(enter)
    }
}

/// Open nodes: a fixed array, and a vector for trees deeper than it.
struct Stack {
    fixed: [(f32, Child); 64],
    len: usize,
    spilled: Vec<(f32, Child)>,
}

impl Stack {
    fn new() -> Self {
        Self { fixed: [(0.0, Child { first: 0, count: 0 }); 64], len: 0, spilled: Vec::new() }
    }

    #[inline]
    fn push(&mut self, entry: (f32, Child)) {
        if self.len < self.fixed.len() {
            self.fixed[self.len] = entry;
            self.len += 1;
        } else {
            self.spilled.push(entry);
        }
    }

    #[inline]
    fn pop(&mut self) -> Option<(f32, Child)> {
        if let Some(entry) = self.spilled.pop() {
            return Some(entry);
        }
        self.len = self.len.checked_sub(1)?;
        Some(self.fixed[self.len])
    }
}

/// The nearest hit that `accept` takes; among equally near ones that of the lowest triangle. With `any` set the first
/// one found, whichever it is.
#[inline]
pub(super) fn traverse(accel: &Accel, ray: &Ray, any: bool, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
    let root = accel.root?;
    if !ray.is_usable() {
        return None;
    }
    let sheared = ShearedRay::new(ray);
    let slab = SlabRay::new(ray, &accel.bounds);
    let mut best: Option<Hit> = None;
    let mut limit = ray.max_distance();
    let mut stack = Stack::new();
    stack.push((0.0, root));
    while let Some((enter, child)) = stack.pop() {
        if enter > limit * WIDENED {
            continue;
        }
        if child.count == 0 {
            open(&accel.nodes[child.first as usize], &slab, limit, &mut stack);
            continue;
        }
        for slot in child.first..child.first + child.count {
            let Some(hit) = accel.intersect(slot, &sheared, limit) else { continue };
            let nearer = best.as_ref().is_none_or(|found| {
                hit.distance < found.distance || (hit.distance == found.distance && hit.global < found.global)
            });
            if nearer && accept(&hit) {
                if any {
                    return Some(hit);
                }
                limit = hit.distance;
                best = Some(hit);
            }
        }
    }
    best
}

/// Pushes the children that the ray meets, the nearer one last.
#[inline(always)]
fn open(node: &Node, slab: &SlabRay, limit: f32, stack: &mut Stack) {
    let enters = [slab.enter(&node.bounds[0], limit), slab.enter(&node.bounds[1], limit)];
    match enters {
        [Some(a), Some(b)] => {
            let (near, far) = if b < a { (1, 0) } else { (0, 1) };
            stack.push((a.max(b), node.children[far]));
            stack.push((a.min(b), node.children[near]));
        }
        [Some(a), None] => stack.push((a, node.children[0])),
        [None, Some(b)] => stack.push((b, node.children[1])),
        [None, None] => {}
    }
}
