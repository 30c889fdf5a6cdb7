//! Measures how far pieces of furniture stand in each other, by their meshes and not by their bounding boxes.
//!
//! The depth of a pair is the shortest way that one piece must be moved for the two to be apart, over eight horizontal
//! directions, up and down. Points on each surface are moved along the direction, and the stretches of their ways that
//! the other piece encloses are where the pieces intersect. The share is the part of the smaller piece's volume that
//! lies in the other. A chair pushed under a table shares no place with it; a back that the tabletop's edge cuts into
//! is apart after a few centimetres; a chair that stands in a wardrobe, hollow or not, only after a step.
//!
//! Furniture is often open (a sofa without a bottom, a cabinet without a back) or made of parts that overlap, so no
//! single ray decides. A place is enclosed where at least eleven of fourteen rays from it cross the surface an odd
//! number of times. A body that lacks a face therefore still encloses what is well inside it; a sheet, such as a
//! tabletop without thickness, a bowl or a shelf's compartment between boards, encloses nothing.

use std::cell::RefCell;
use std::sync::OnceLock;

use glam::{Quat, Vec3};
use mateval_dataset::TriangleMesh;
use mateval_tracer::{Accel, Ray, TracerError};
use rayon::prelude::*;

/// The largest depth that is measured, in metres.
pub const MOST_DEPTH_M: f64 = 0.5;

/// The least depth of a pair that is listed, in metres. Shelves side by side and lamps on tables sink in a little less.
pub const LEAST_DEPTH_M: f64 = 0.005;

/// How far two pieces must be movable without touching to be apart, in metres. Points on surfaces are about as dense.
const FREE_M: f32 = 0.03;

/// The directions in which pieces are moved apart.
const DIRECTIONS: [Vec3; 10] = [
    Vec3::X,
    Vec3::NEG_X,
    Vec3::Z,
    Vec3::NEG_Z,
    Vec3::new(HALF, 0.0, HALF),
    Vec3::new(-HALF, 0.0, HALF),
    Vec3::new(HALF, 0.0, -HALF),
    Vec3::new(-HALF, 0.0, -HALF),
    Vec3::Y,
    Vec3::NEG_Y,
];
const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshIntersection {
    /// Their indices, the lower one first.
    pub pair: [usize; 2],
    /// The shortest way that separates them, in metres, at most [`MOST_DEPTH_M`].
    pub depth_m: f64,
    /// The part of the smaller one's volume that lies in the other, 0 to 1; of its surface, where it encloses nothing.
    pub volume_share: f64,
}

/// The pairs of meshes that intersect by at least [`LEAST_DEPTH_M`], sorted.
pub fn intersections(meshes: &[&TriangleMesh]) -> Result<Vec<MeshIntersection>, TracerError> {
    let solids: Vec<Solid<'_>> = meshes.par_iter().map(|mesh| Solid::new(mesh)).collect::<Result<_, TracerError>>()?;
    let pairs: Vec<[usize; 2]> = (0..solids.len()).flat_map(|a| (a + 1..solids.len()).map(move |b| [a, b])).collect();
    let measured = |&pair: &[usize; 2]| {
        let [a, b] = pair.map(|at| &solids[at]);
        let depth_m = rounded(depth(a, b)?);
        (depth_m >= LEAST_DEPTH_M).then(|| MeshIntersection { pair, depth_m, volume_share: rounded(share(a, b)) })
    };
    Ok(pairs.par_iter().filter_map(measured).collect())
}

/// To a tenth of a millimetre or of a thousandth: more is noise.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// The shortest way that separates the pieces, in metres; absent if they do not intersect.
fn depth(a: &Solid<'_>, b: &Solid<'_>) -> Option<f64> {
    if !boxes_overlap(a, b) || !(lies_partly_in(a, b) || lies_partly_in(b, a)) {
        return None;
    }
    let ways = DIRECTIONS.par_iter().map(|direction| way_out(a, b, *direction)).collect::<Vec<f32>>();
    ways.into_iter().reduce(f32::min).map(f64::from)
}

fn boxes_overlap(a: &Solid<'_>, b: &Solid<'_>) -> bool {
    let ([low_a, high_a], [low_b, high_b]) = (a.bounds(), b.bounds());
    low_a.cmplt(high_b).all() && low_b.cmplt(high_a).all()
}

fn lies_partly_in(one: &Solid<'_>, other: &Solid<'_>) -> bool {
    one.on_surface().iter().any(|place| other.encloses(*place))
}

/// How far `a` must be moved in a direction so that it does not touch `b`, and could be moved on a little.
fn way_out(a: &Solid<'_>, b: &Solid<'_>, direction: Vec3) -> f32 {
    let reach = MOST_DEPTH_M as f32;
    let of_a = a.on_surface().iter().flat_map(|place| b.enclosed_along(*place, direction, reach));
    // To move the one is to move the other the opposite way.
    let of_b = b.on_surface().iter().flat_map(|place| a.enclosed_along(*place, -direction, reach));
    let mut stretches: Vec<[f32; 2]> = of_a.chain(of_b).collect();
    stretches.sort_by(|one, other| one[0].total_cmp(&other[0]));
    let mut way = 0.0_f32;
    for [begin, end] in stretches {
        // The first gap counts only if the pieces touch at all without being moved.
        let free = if way == 0.0 { 0.0 } else { FREE_M };
        if begin > way + free {
            break;
        }
        way = way.max(end);
    }
    way
}

/// The part of the smaller piece that lies in the other.
fn share(a: &Solid<'_>, b: &Solid<'_>) -> f64 {
    let (small, large) = if b.volume_m3() < a.volume_m3() { (b, a) } else { (a, b) };
    let points = match small.enclosed_points() {
        [] => small.on_surface(),
        points => points,
    };
    let inside = points.iter().filter(|place| large.encloses(**place)).count();
    inside as f64 / points.len().max(1) as f64
}

/// Axes along which rays leave a place both ways: those of a cube's faces and corners.
const AXES: [Vec3; 7] = [
    Vec3::X,
    Vec3::Y,
    Vec3::Z,
    Vec3::new(1.0, 1.0, 1.0),
    Vec3::new(-1.0, 1.0, 1.0),
    Vec3::new(1.0, -1.0, 1.0),
    Vec3::new(1.0, 1.0, -1.0),
];

/// Turns the axes, so that they follow no edge of furniture that stands along the walls.
const OBLIQUE: Quat = Quat::from_xyzw(0.13, 0.21, 0.08, 0.965_608_6);

/// The most of the fourteen rays that may cross an even number of faces.
const MOST_EVEN: usize = 3;

/// Mean distance between points on a surface, in metres.
const SPACING_M: f64 = 0.02;

/// The least and the largest number of points on a surface.
const POINTS: [usize; 2] = [500, 6000];

/// Points of the grid along each side of a piece's box.
const GRID: usize = 16;

/// Segments of a ray that are shorter than this are left out, in metres: faces that coincide.
const THINNEST_M: f32 = 1e-4;

/// A piece with its acceleration structure.
struct Solid<'a> {
    mesh: &'a TriangleMesh,
    accel: Accel,
    on_surface: OnceLock<Vec<Vec3>>,
    enclosed: OnceLock<Vec<Vec3>>,
}

impl<'a> Solid<'a> {
    fn new(mesh: &'a TriangleMesh) -> Result<Self, TracerError> {
        let accel = Accel::build(&[mesh])?;
        Ok(Self { mesh, accel, on_surface: OnceLock::new(), enclosed: OnceLock::new() })
    }

    /// The lower and upper corner of its box.
    fn bounds(&self) -> [Vec3; 2] {
        self.accel.bounds()
    }

    /// Whether the piece encloses the place.
    fn encloses(&self, place: Vec3) -> bool {
        let [low, high] = self.bounds();
        if !(place.cmpge(low).all() && place.cmple(high).all()) {
            return false;
        }
        let mut even = 0;
        AXES.into_iter().flat_map(|axis| [axis, -axis]).all(|axis| {
            let ray = Ray::endless(place, (OBLIQUE * axis).normalize());
            even += usize::from(self.crossings(&ray).len().is_multiple_of(2));
            even <= MOST_EVEN
        })
    }

    /// The parts of a ray's first `reach` metres that the piece encloses: where each begins and ends, sorted.
    fn enclosed_along(&self, from: Vec3, direction: Vec3, reach: f32) -> Vec<[f32; 2]> {
        let Some([enter, leave]) = self.within_box(from, direction, reach) else { return Vec::new() };
        let mut places = vec![enter];
        places.extend(self.crossings(&Ray::new(from, direction, leave)));
        places.push(leave);
        let pieces = places.windows(2).map(|pair| [pair[0], pair[1]]);
        let is_enclosed = |[begin, end]: &[f32; 2]| {
            end - begin > THINNEST_M && self.encloses(from + direction * ((begin + end) / 2.0))
        };
        pieces.filter(is_enclosed).collect()
    }

    /// Where a ray enters and leaves the piece's box; absent if it does not meet it.
    fn within_box(&self, from: Vec3, direction: Vec3, reach: f32) -> Option<[f32; 2]> {
        let [low, high] = self.bounds();
        let (mut enter, mut leave) = (0.0_f32, reach);
        for axis in 0..3 {
            let (at, step) = (from[axis], direction[axis]);
            if step == 0.0 {
                if at < low[axis] || at > high[axis] {
                    return None;
                }
                continue;
            }
            let (one, other) = ((low[axis] - at) / step, (high[axis] - at) / step);
            (enter, leave) = (enter.max(one.min(other)), leave.min(one.max(other)));
        }
        (enter < leave).then_some([enter, leave])
    }

    /// The distances at which a ray crosses the surface, sorted.
    fn crossings(&self, ray: &Ray) -> Vec<f32> {
        let distances = RefCell::new(Vec::new());
        // Every hit is rejected, so that the ray visits all of them.
        self.accel.closest_where(ray, |hit| {
            distances.borrow_mut().push(hit.distance);
            false
        });
        let mut distances = distances.into_inner();
        distances.sort_by(f32::total_cmp);
        distances
    }

    /// Points on the surface, evenly over its area.
    fn on_surface(&self) -> &[Vec3] {
        self.on_surface.get_or_init(|| points_on(self.mesh))
    }

    /// The points of a grid over its box that it encloses.
    fn enclosed_points(&self) -> &[Vec3] {
        self.enclosed.get_or_init(|| {
            let [low, high] = self.bounds();
            let at = |k: usize| (k as f32 + 0.5) / GRID as f32;
            let place =
                |k: usize| low + (high - low) * Vec3::new(at(k % GRID), at(k / GRID % GRID), at(k / GRID / GRID));
            (0..GRID * GRID * GRID).map(place).filter(|place| self.encloses(*place)).collect()
        })
    }

    /// The volume that it encloses, in cubic metres.
    fn volume_m3(&self) -> f64 {
        let [low, high] = self.bounds().map(Vec3::as_dvec3);
        let share = self.enclosed_points().len() as f64 / (GRID * GRID * GRID) as f64;
        (high - low).element_product() * share
    }
}

/// Points on a mesh: each lies in the middle of its part of the area, at a place of the triangle that a sequence of low
/// discrepancy gives (the R2 sequence of Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
fn points_on(mesh: &TriangleMesh) -> Vec<Vec3> {
    let mut total = 0.0;
    let sums: Vec<f64> = (0..mesh.triangles.len())
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
            total += (b - a).cross(c - a).length() / 2.0;
            total
        })
        .collect();
    let count = ((total / (SPACING_M * SPACING_M)) as usize).clamp(POINTS[0], POINTS[1]);
    let point = |k: usize| {
        let area = (k as f64 + 0.5) / count as f64 * total;
        let triangle = sums.partition_point(|sum| *sum < area).min(sums.len() - 1);
        let [u, v] = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (step * k as f64).fract());
        let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
        let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
        (a + (b - a) * u + (c - a) * v).as_vec3()
    };
    if sums.is_empty() { Vec::new() } else { (0..count).map(point).collect() }
}

#[cfg(test)]
mod tests {

    use super::*;

    /// A block with its faces along the axes.
    fn block(middle: Vec3, size: Vec3) -> TriangleMesh {
        let corner = |k: u32| middle + (Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32) - 0.5) * size;
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        TriangleMesh {
            positions: (0..8).map(corner).collect(),
            triangles: faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).collect(),
            ..Default::default()
        }
    }

    /// Blocks from their lowest to their highest corners, as one mesh.
    fn blocks(corners: &[[[f32; 3]; 2]]) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for [low, high] in corners.iter().map(|pair| pair.map(Vec3::from_array)) {
            mesh.append(&block((low + high) / 2.0, high - low));
        }
        mesh
    }

    fn moved(mut mesh: TriangleMesh, by: Vec3) -> TriangleMesh {
        mesh.positions.iter_mut().for_each(|position| *position += by);
        mesh
    }

    /// A table of 1.6 by 0.9 m, 0.75 m high, with its middle at the origin: a top of 3 cm and four legs.
    fn table() -> TriangleMesh {
        let mut corners = vec![[[-0.8, 0.72, -0.45], [0.8, 0.75, 0.45]]];
        for (x, z) in [(-0.78, -0.43), (0.73, -0.43), (-0.78, 0.38), (0.73, 0.38)] {
            corners.push([[x, 0.0, z], [x + 0.05, 0.72, z + 0.05]]);
        }
        blocks(&corners)
    }

    /// A chair of 45 by 45 cm that faces -Z: a seat at 45 cm, four legs, and a back that is 90 cm high, at z from 0.19
    /// to 0.22.
    fn chair() -> TriangleMesh {
        let mut corners = vec![[[-0.22, 0.42, -0.22], [0.22, 0.46, 0.22]], [[-0.22, 0.46, 0.19], [0.22, 0.9, 0.22]]];
        for (x, z) in [(-0.22, -0.22), (0.18, -0.22), (-0.22, 0.18), (0.18, 0.18)] {
            corners.push([[x, 0.0, z], [x + 0.04, 0.42, z + 0.04]]);
        }
        blocks(&corners)
    }

    /// A wardrobe of 1 by 2 by 0.6 m made of boards of 2 cm, hollow; its front, at z = 0.3, is closed.
    fn wardrobe_of_boards() -> TriangleMesh {
        blocks(&[
            [[-0.5, 0.0, -0.3], [0.5, 0.02, 0.3]],
            [[-0.5, 1.98, -0.3], [0.5, 2.0, 0.3]],
            [[-0.5, 0.02, -0.3], [-0.48, 1.98, 0.3]],
            [[0.48, 0.02, -0.3], [0.5, 1.98, 0.3]],
            [[-0.48, 0.02, -0.3], [0.48, 1.98, -0.28]],
            [[-0.48, 0.02, 0.28], [0.48, 1.98, 0.3]],
        ])
    }

    /// A sphere of triangles whose edges are about two centimetres long for a radius of 0.3 m.
    fn ball(middle: Vec3, radius: f32) -> TriangleMesh {
        const SIDES: u32 = 96;
        let mut mesh = TriangleMesh::default();
        for ring in 0..=SIDES / 2 {
            for side in 0..SIDES {
                let (up, around) = (f64::from(ring) / f64::from(SIDES / 2), f64::from(side) / f64::from(SIDES));
                let ((sin, cos), (s, c)) =
                    (libm::sincos(up * std::f64::consts::PI), libm::sincos(around * std::f64::consts::TAU));
                let out = glam::DVec3::new(sin * c, cos, sin * s).as_vec3();
                mesh.positions.push(middle + out * radius);
                if ring > 0 {
                    let [here, next] = [side, (side + 1) % SIDES].map(|side| ring * SIDES + side);
                    mesh.triangles.extend([[here, next, here - SIDES], [next, next - SIDES, here - SIDES]]);
                }
            }
        }
        mesh
    }

    /// Depth and share of the two; absent if they do not intersect.
    fn of(a: &TriangleMesh, b: &TriangleMesh) -> Option<[f64; 2]> {
        let found = intersections(&[a, b]).unwrap();
        assert!(found.len() <= 1 && found.iter().all(|found| found.pair == [0, 1]));
        // The order does not matter.
        let swapped = intersections(&[b, a]).unwrap();
        assert_eq!(found.first().map(|found| found.depth_m), swapped.first().map(|found| found.depth_m));
        found.first().map(|found| [found.depth_m, found.volume_share])
    }

    #[track_caller]
    fn assert_near(found: Option<[f64; 2]>, [depth, share]: [f64; 2], within: [f64; 2]) {
        let [found_depth, found_share] = found.expect("they intersect");
        assert!((found_depth - depth).abs() <= within[0], "depth {found_depth}, expected {depth}");
        assert!((found_share - share).abs() <= within[1], "share {found_share}, expected {share}");
    }

    #[test]
    fn blocks_that_overlap_touch_and_are_apart() {
        let at = |x: f32, y: f32, z: f32| {
            of(&block(Vec3::ZERO, Vec3::ONE), &block(Vec3::new(x, y, z), Vec3::new(1.0, 1.0, 1.5)))
        };
        assert_near(at(0.9, 0.3, 0.0), [0.1, 0.1 * 0.7], [1e-3, 0.03]);
        assert_near(at(0.7, 0.0, 0.1), [0.3, 0.3], [1e-3, 0.03]);
        // Deeper than what is measured.
        assert_near(at(0.1, 0.1, 0.1), [0.5, 0.9 * 0.9], [1e-6, 0.05]);
        // By a corner: 20 cm along x or y, less than the way along the diagonal.
        assert_near(at(0.8, 0.8, 0.0), [0.2, 0.04], [1e-3, 0.03]);
        assert_eq!(at(0.998, 0.3, 0.2), None);
        assert_eq!(at(1.0, 0.3, 0.2), None);
        assert_eq!(at(1.5, 0.0, 0.0), None);
    }

    /// Only their boxes overlap; with the back 4 cm inside the top's edge, they are 4 cm from being apart.
    #[test]
    fn chairs_at_tables() {
        let pushed = |z: f32| of(&moved(chair(), Vec3::new(0.1, 0.0, z)), &table());
        assert_eq!(pushed(0.27), None);
        let [depth, share] = pushed(0.22).unwrap();
        assert!((depth - 0.04).abs() < 0.005 && share < 0.02, "{depth} {share}");
        // In the middle of the top: to lower it by 18 cm is the shortest way.
        let [depth, share] = pushed(-0.1).unwrap();
        assert!((depth - 0.18).abs() < 0.005 && share < 0.05, "{depth} {share}");
    }

    #[test]
    fn a_chair_in_a_wardrobe_hollow_or_not() {
        let chair = moved(chair(), Vec3::new(0.0, 0.03, 0.3));
        for wardrobe in [wardrobe_of_boards(), block(Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, 2.0, 0.6))] {
            let [depth, _] = of(&chair, &wardrobe).unwrap();
            assert!((depth - 0.22).abs() < 0.01, "{depth}");
        }
        assert_eq!(of(&moved(chair, Vec3::Z * 0.23), &wardrobe_of_boards()), None);
    }

    /// The bounding boxes of two crossed poles overlap; the poles do not.
    #[test]
    fn overlapping_boxes_are_not_enough() {
        let pole = |size: Vec3, height: f32| {
            let mut mesh = block(Vec3::Y * height, size);
            for p in &mut mesh.positions {
                *p = glam::Quat::from_rotation_x(0.5) * *p;
            }
            mesh
        };
        let (thin, long) = (Vec3::new(0.05, 0.05, 2.0), Vec3::new(2.0, 0.05, 0.05));
        assert_eq!(of(&pole(thin, 0.0), &pole(long, 0.2)), None);
        assert!(of(&pole(thin, 0.0), &pole(long, 0.0)).unwrap()[0] > 0.04);
    }

    /// The share of two balls of radius 1 whose middles are 1 apart: 5/16 (Weisstein, "Sphere-Sphere Intersection").
    #[test]
    fn fine_meshes_intersect() {
        let pair = |apart: f32| of(&ball(Vec3::ZERO, 0.3), &ball(Vec3::X * apart, 0.3));
        assert_near(pair(0.3), [0.3, 5.0 / 16.0], [0.005, 0.03]);
        assert!(pair(0.58).unwrap()[0] < 0.025);
        assert_eq!(pair(0.7), None);
    }

    /// A cup in an open bowl is not inside the bowl's mesh.
    #[test]
    fn an_open_mesh_encloses_nothing() {
        let mut bowl = ball(Vec3::ZERO, 0.3);
        bowl.triangles.retain(|triangle| triangle.iter().all(|vertex| bowl.positions[*vertex as usize].y < 0.1));
        assert_eq!(of(&bowl, &ball(Vec3::ZERO, 0.05)), None);
        // The twin: the same cup in a closed ball does intersect it.
        assert_near(of(&ball(Vec3::ZERO, 0.3), &ball(Vec3::ZERO, 0.05)), [0.35, 1.0], [0.01, 1e-6]);
    }

    #[test]
    fn a_block_encloses_its_volume_and_its_surface_is_covered() {
        let mesh = block(Vec3::ZERO, Vec3::new(2.0, 1.0, 0.5));
        let solid = Solid::new(&mesh).unwrap();
        assert!((solid.volume_m3() - 1.0).abs() < 1e-6, "{}", solid.volume_m3());
        let points = solid.on_surface();
        // 7 m2 of surface; the two largest faces have 2 m2 each.
        let top = points.iter().filter(|p| (p.z - 0.25).abs() < 1e-6).count();
        assert!((top as f64 / points.len() as f64 - 2.0 / 7.0).abs() < 0.01);
        assert!(solid.encloses(Vec3::new(0.9, 0.4, 0.2)) && !solid.encloses(Vec3::new(0.9, 0.4, 0.3)));
        let along = solid.enclosed_along(Vec3::new(-2.0, 0.1, 0.1), Vec3::X, 5.0);
        assert!(along.len() == 1 && (along[0][0] - 1.0).abs() < 1e-5 && (along[0][1] - 3.0).abs() < 1e-5, "{along:?}");
        assert!(solid.enclosed_along(Vec3::new(-2.0, 0.1, 0.1), Vec3::NEG_X, 5.0).is_empty());
    }

    /// What lacks a face is still a body; a bowl, a sheet and the space under a table are not.
    #[test]
    fn open_bodies_enclose_what_is_well_inside() {
        let mut cabinet = block(Vec3::ZERO, Vec3::ONE);
        cabinet.triangles.retain(|triangle| triangle.iter().any(|vertex| cabinet.positions[*vertex as usize].y > 0.0));
        assert_eq!(cabinet.triangles.len(), 10);
        let open = Solid::new(&cabinet).unwrap();
        assert!(open.encloses(Vec3::splat(0.1)) && !open.encloses(Vec3::new(0.0, -0.45, 0.0)));
        let mut bowl = ball(Vec3::ZERO, 0.3);
        bowl.triangles.retain(|triangle| triangle.iter().all(|vertex| bowl.positions[*vertex as usize].y < 0.1));
        assert!(!Solid::new(&bowl).unwrap().encloses(Vec3::ZERO));
        let sheet = block(Vec3::ZERO, Vec3::new(2.0, 0.0, 1.0));
        assert!(!Solid::new(&sheet).unwrap().encloses(Vec3::new(0.0, -0.1, 0.0)));
    }
}
