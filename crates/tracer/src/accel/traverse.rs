//! Walks a ray through the hierarchy.

use super::kernel::{BoxRay, Boxes, Kernel, Stack, TriangleRay, Triangles};
use super::wide::{Block, Child, Node, WIDTH, Wide};
use crate::ray::Ray;

/// A triangle that a ray hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    pub(super) distance: f32,
    pub(super) triangle: u32,
    pub(super) surface: u32,
    /// Weights of the corners, not yet divided by their sum.
    pub(super) weights: [f32; 3],
}

impl Candidate {
    #[inline(always)]
    pub(super) fn new(block: &Block, found: &Triangles, lane: usize) -> Self {
        Self {
            distance: found.distance[lane],
            triangle: block.triangles[lane],
            surface: block.surfaces[lane],
            weights: found.weights.map(|weights| weights[lane]),
        }
    }

    /// Whether it is nearer, or as near and of a lower triangle: so the shape of the tree never shows.
    #[inline(always)]
    pub(super) fn comes_before(&self, other: &Self) -> bool {
        self.distance < other.distance || (self.distance == other.distance && self.triangle < other.triangle)
    }
}

/// The nearest hit that `accept` takes; among equally near ones that of the lowest triangle. With `ANY` the first one
/// found, whichever it is.
#[inline(always)]
pub(super) fn traverse<K: Kernel, const WATERTIGHT: bool, const ANY: bool>(
    kernel: K,
    wide: &Wide,
    scene_size: f32,
    ray: &Ray,
    accept: impl Fn(&Candidate) -> bool,
) -> Option<Candidate> {
    let box_ray = BoxRay::new(ray, scene_size);
    let triangle_ray = TriangleRay::new(ray, &box_ray);
    let mut best: Option<Candidate> = None;
    let mut limit = ray.max_distance();
    let mut stack = Stack::new();
    let mut next = Some(wide.root);
    while let Some(child) = next {
        if !child.is_block() {
            let node = &wide.nodes[child.place()];
            let boxes = kernel.boxes(node, &box_ray, limit);
            let child = if ANY {
                in_any_order(kernel, wide, node, boxes.met, &mut stack)
            } else {
                nearest_first(kernel, wide, node, &boxes, &mut stack)
            };
            next = child.or_else(|| stack.pop(limit));
            continue;
        }
        let block = &wide.blocks[child.place()];
        let found = kernel.triangles::<WATERTIGHT>(block, &triangle_ray, limit);
        let mut lanes = found.hit;
        while lanes != 0 {
            let candidate = Candidate::new(block, &found, lanes.trailing_zeros() as usize & (WIDTH - 1));
            lanes &= lanes - 1;
            if best.as_ref().is_none_or(|best| candidate.comes_before(best)) && accept(&candidate) {
                if ANY {
                    return Some(candidate);
                }
                limit = candidate.distance;
                best = Some(candidate);
            }
        }
        next = stack.pop(limit);
    }
    best
}

/// The nearest child met, if any; the others are pushed, the farthest first.
#[inline(always)]
fn nearest_first<K: Kernel>(
    kernel: K,
    wide: &Wide,
    node: &Node,
    boxes: &Boxes<K::Lanes>,
    stack: &mut Stack,
) -> Option<Child> {
    match boxes.met.count_ones() {
        0 => None,
        1 => Some(node.children[boxes.met.trailing_zeros() as usize & (WIDTH - 1)]),
        _ => {
            kernel.push_sorted(node, boxes, stack);
            let nearest = stack.pop(f32::INFINITY);
            if let Some(next) = stack.top() {
                prefetch(kernel, wide, next);
            }
            nearest
        }
    }
}

/// One of the children met, if any; the others are pushed.
#[inline(always)]
fn in_any_order<K: Kernel>(kernel: K, wide: &Wide, node: &Node, met: u32, stack: &mut Stack) -> Option<Child> {
    let child = |met: u32| node.children[met.trailing_zeros() as usize & (WIDTH - 1)];
    let mut rest = met;
    while rest & rest.wrapping_sub(1) != 0 {
        stack.push(0, child(rest));
        rest &= rest - 1;
    }
    if rest != met {
        prefetch(kernel, wide, child(met));
    }
    (met != 0).then(|| child(rest))
}

#[inline(always)]
fn prefetch<K: Kernel>(kernel: K, wide: &Wide, child: Child) {
    if child.is_block() {
        kernel.prefetch(&wide.blocks[child.place()]);
    } else {
        kernel.prefetch(&wide.nodes[child.place()]);
    }
}
