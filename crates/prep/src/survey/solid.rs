//! A piece of furniture as a solid body: which places it encloses, and points on it and in it.
//!
//! Furniture is often open (a sofa without a bottom, a cabinet without a back) or made of parts that overlap, so no single
//! ray decides. A place is enclosed where at least eleven of fourteen rays from it cross the surface an odd number of times.
//! A body that lacks a face therefore still encloses what is well inside it; a sheet, such as a tabletop without
//! thickness, a bowl or a shelf's compartment between boards, encloses nothing.

use std::cell::RefCell;
use std::sync::OnceLock;

use glam::{Quat, Vec3};
use mateval_scene::TriangleMesh;
use mateval_tracer::{Accel, Ray, TracerError};

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
pub(super) struct Solid<'a> {
    mesh: &'a TriangleMesh,
    accel: Accel,
    on_surface: OnceLock<Vec<Vec3>>,
    enclosed: OnceLock<Vec<Vec3>>,
}

impl<'a> Solid<'a> {
    pub(super) fn new(mesh: &'a TriangleMesh) -> Result<Self, TracerError> {
        let accel = Accel::build(&[mesh])?;
        Ok(Self { mesh, accel, on_surface: OnceLock::new(), enclosed: OnceLock::new() })
    }

    /// The lower and upper corner of its box.
    pub(super) fn bounds(&self) -> [Vec3; 2] {
        self.accel.bounds()
    }

    /// Whether the piece encloses the place.
    pub(super) fn encloses(&self, place: Vec3) -> bool {
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
    pub(super) fn enclosed_along(&self, from: Vec3, direction: Vec3, reach: f32) -> Vec<[f32; 2]> {
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

    /// Where a ray enters and leaves the piece's box; none where it does not meet it.
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
    pub(super) fn on_surface(&self) -> &[Vec3] {
        self.on_surface.get_or_init(|| points_on(self.mesh))
    }

    /// The points of a grid over its box that it encloses.
    pub(super) fn enclosed_points(&self) -> &[Vec3] {
        self.enclosed.get_or_init(|| {
            let [low, high] = self.bounds();
            let at = |k: usize| (k as f32 + 0.5) / GRID as f32;
            let place =
                |k: usize| low + (high - low) * Vec3::new(at(k % GRID), at(k / GRID % GRID), at(k / GRID / GRID));
            (0..GRID * GRID * GRID).map(place).filter(|place| self.encloses(*place)).collect()
        })
    }

    /// The volume that it encloses, in cubic metres.
    pub(super) fn volume_m3(&self) -> f64 {
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
    use super::super::shapes::{ball, block};
    use super::*;

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
