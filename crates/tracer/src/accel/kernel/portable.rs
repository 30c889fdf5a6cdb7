//! The kernel for every processor: the formulas, lane by lane.

use super::lanes::{Boxes, Kernel, Triangles, key};
use super::stack::Stack;
use super::test_ray::{BoxRay, TriangleRay, WIDENED};
use crate::accel::wide::{Block, Node, WIDTH};

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

    fn triangles<const WATERTIGHT: bool>(self, block: &Block, ray: &TriangleRay, limit: f32) -> Triangles {
        let mut found = Triangles { hit: 0, distance: [0.0; WIDTH], weights: [[0.0; WIDTH]; 3] };
        for lane in 0..WIDTH {
            let corners = block.corners.map(|axes| axes.map(|values| values[lane]));
            let hit = if WATERTIGHT { watertight(&corners, ray) } else { fast(&corners, ray) };
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

fn fast(corners: &[[f32; 3]; 3], ray: &TriangleRay) -> Option<LaneHit> {
    let minus = |p: [f32; 3], q: [f32; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let [first, second] = [minus(corners[1], corners[0]), minus(corners[2], corners[0])];
    let across = cross(ray.direction, second);
    let determinant = dot(first, across);
    let from = minus(ray.origin, corners[0]);
    let v = dot(from, across);
    let along = cross(from, first);
    let w = dot(ray.direction, along);
    let u = (determinant - v) - w;
    let (all_above, all_below) = (u >= 0.0 && v >= 0.0 && w >= 0.0, u <= 0.0 && v <= 0.0 && w <= 0.0);
    if !(all_above || all_below) || determinant == 0.0 {
        return None;
    }
    Some(LaneHit { distance: dot(second, along) / determinant, weights: [u, v, w] })
}

fn cross(p: [f32; 3], q: [f32; 3]) -> [f32; 3] {
    let part = |a: f32, b: f32, c: f32, d: f32| a.mul_add(b, -(c * d));
    [part(p[1], q[2], p[2], q[1]), part(p[2], q[0], p[0], q[2]), part(p[0], q[1], p[1], q[0])]
}

fn dot(p: [f32; 3], q: [f32; 3]) -> f32 {
    p[2].mul_add(q[2], p[1].mul_add(q[1], p[0] * q[0]))
}
