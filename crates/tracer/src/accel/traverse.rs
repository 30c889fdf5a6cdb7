//! Traversal of the hierarchy, for single rays and for many at once.

use arrayvec::ArrayVec;

use super::kernel::{Block, BoxRay, Boxes, Child, Kernel, Node, Stack, TriangleRay, Triangles, WIDTH, prefetch};
use super::wide::Wide;
use crate::ray::Ray;

/// A triangle hit by a ray.
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

    /// Whether this hit is nearer, or equally near with a lower triangle index, so that the shape of the tree never
    /// shows.
    #[inline(always)]
    pub(super) fn comes_before(&self, other: &Self) -> bool {
        self.distance < other.distance || (self.distance == other.distance && self.triangle < other.triangle)
    }
}

/// The state of one ray during traversal. With `ANY` the traversal ends at the first hit found. `ALONE` selects what is
/// fastest for a single ray, which waits for memory; many rays in turn wait for mispredicted branches instead.
struct Walk<const ANY: bool, const ALONE: bool> {
    box_ray: BoxRay,
    triangle_ray: TriangleRay,
    best: Option<Candidate>,
    /// The largest distance of hits still sought.
    limit: f32,
    stack: Stack,
    /// The node or block to visit next; `None` at the end.
    next: Option<Child>,
}

impl<const ANY: bool, const ALONE: bool> Walk<ANY, ALONE> {
    #[inline(always)]
    fn new(wide: &Wide, scene_size: f32, ray: &Ray) -> Self {
        let box_ray = BoxRay::new(ray, scene_size);
        Self {
            triangle_ray: TriangleRay::new(ray, &box_ray),
            box_ray,
            best: None,
            limit: ray.max_distance(),
            stack: Stack::new(),
            next: Some(wide.root),
        }
    }

    /// Starts with another ray in place, since moving the long stack would cost time.
    #[inline(always)]
    fn restart(&mut self, wide: &Wide, scene_size: f32, ray: &Ray) {
        self.box_ray = BoxRay::new(ray, scene_size);
        self.triangle_ray = TriangleRay::new(ray, &self.box_ray);
        self.best = None;
        self.limit = ray.max_distance();
        self.stack.clear();
        self.next = Some(wide.root);
    }

    /// Visits `child`, the former `next`.
    #[inline(always)]
    fn step<K: Kernel>(&mut self, kernel: K, wide: &Wide, child: Child, accept: impl Fn(&Candidate) -> bool) {
        if child.is_block() {
            self.enter_block(kernel, &wide.blocks[child.place()], accept);
            if ANY && self.best.is_some() {
                self.next = None;
                return;
            }
            self.next = self.stack.pop(self.limit);
        } else {
            let node = &wide.nodes[child.place()];
            let boxes = kernel.boxes(node, &self.box_ray, self.limit);
            let inner = if ALONE {
                nearest_first(kernel, node, &boxes, &mut self.stack)
            } else {
                kernel.push_sorted(node, &boxes, &mut self.stack);
                None
            };
            self.next = inner.or_else(|| self.stack.pop(self.limit));
        }
    }

    #[inline(always)]
    fn enter_block<K: Kernel>(&mut self, kernel: K, block: &Block, accept: impl Fn(&Candidate) -> bool) {
        let found = kernel.triangles(block, &self.triangle_ray, self.limit);
        let mut lanes = found.hit;
        while lanes != 0 {
            let candidate = Candidate::new(block, &found, lanes.trailing_zeros() as usize & (WIDTH - 1));
            lanes &= lanes - 1;
            if self.best.as_ref().is_none_or(|best| candidate.comes_before(best)) && accept(&candidate) {
                self.best = Some(candidate);
                if ANY {
                    return;
                }
                self.limit = candidate.distance;
            }
        }
    }
}

/// The nearest hit that `accept` returns true for; among equally near hits, the one of lowest triangle index. With
/// `ANY`, the first such hit found.
#[inline(always)]
pub(super) fn traverse<K: Kernel, const ANY: bool>(
    kernel: K,
    wide: &Wide,
    scene_size: f32,
    ray: &Ray,
    accept: impl Fn(&Candidate) -> bool,
) -> Option<Candidate> {
    let mut walk = Walk::<ANY, true>::new(wide, scene_size, ray);
    while let Some(child) = walk.next {
        walk.step(kernel, wide, child, &accept);
        if let Some(top) = walk.stack.top() {
            prefetch_child(wide, top);
        }
    }
    walk.best
}

/// The number of rays in progress at once in [`traverse_many`].
const AT_ONCE: usize = 12;

/// [`traverse`] for many rays. `found` is called once per ray, in any order. Several rays are in progress at once and
/// step in turn: while one waits for memory, the others compute.
#[inline(always)]
pub(super) fn traverse_many<K: Kernel, const ANY: bool>(
    kernel: K,
    wide: &Wide,
    scene_size: f32,
    rays: &[Ray],
    accept: impl Fn(usize, &Candidate) -> bool,
    mut found: impl FnMut(usize, Option<Candidate>),
) {
    // Start the first rays.
    let mut waiting = (0..rays.len()).filter(|&which| rays[which].is_usable());
    let mut walks: ArrayVec<Walk<ANY, false>, AT_ONCE> = ArrayVec::new();
    let mut rays_of = [0; AT_ONCE];
    for which in waiting.by_ref().take(AT_ONCE) {
        rays_of[walks.len()] = which;
        walks.push(Walk::new(wide, scene_size, &rays[which]));
    }
    while !walks.is_empty() {
        let mut turn = 0;
        while turn < walks.len() {
            let (which, walk) = (rays_of[turn], &mut walks[turn]);
            // Step a ray that has not finished, and prefetch what it visits in its next turn.
            if let Some(child) = walk.next {
                walk.step(kernel, wide, child, |candidate| accept(which, candidate));
                if let Some(next) = walk.next {
                    prefetch_child(wide, next);
                }
                turn += 1;
                continue;
            }
            // Report a finished ray, and give its place to the next one that waits, or to the last one in progress.
            found(which, walk.best);
            if let Some(another) = waiting.next() {
                rays_of[turn] = another;
                walk.restart(wide, scene_size, &rays[another]);
            } else {
                rays_of.swap(turn, walks.len() - 1);
                walks.swap_remove(turn);
            }
        }
    }
}

/// Returns the nearest child met, if any, and pushes the others, the farthest first.
#[inline(always)]
fn nearest_first<K: Kernel>(kernel: K, node: &Node, boxes: &Boxes<K::Lanes>, stack: &mut Stack) -> Option<Child> {
    match boxes.met.count_ones() {
        0 => None,
        1 => Some(node.children[boxes.met.trailing_zeros() as usize & (WIDTH - 1)]),
        _ => {
            kernel.push_sorted(node, boxes, stack);
            stack.pop(f32::INFINITY)
        }
    }
}

#[inline(always)]
fn prefetch_child(wide: &Wide, child: Child) {
    if child.is_block() {
        prefetch(&wide.blocks[child.place()]);
    } else {
        prefetch(&wide.nodes[child.place()]);
    }
}
