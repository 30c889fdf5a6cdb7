//! A point on a surface, with its normals, and the rays that start there.

use glam::{Vec2, Vec3};
use mateval_scene::reference::SurfaceIndex;

use crate::accel::TriangleIndex;
use crate::ray::Ray;
use crate::triangle_record::{ROUNDING, TriangleRecord};

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// The surface.
    pub surface: SurfaceIndex,
    /// The triangle of that surface.
    pub triangle: TriangleIndex,
    /// World space, interpolated between the triangle's corners, so it is as exact as the mesh.
    pub position: Vec3,
    /// The triangle's normal on its front, unit length. The front is the side of the vertex normals, or without them
    /// the side from which the corners run counter-clockwise.
    pub geometric_normal: Vec3,
    /// The interpolated vertex normal, unit length, on the same side. The geometric normal if there are no vertex
    /// normals, or if they interpolate to zero or to the other side.
    pub shading_normal: Vec3,
    /// The uv of the surface; zero if it has none.
    pub uv: Vec2,
    /// The distance from the surface at which rays start so that they do not hit it again, in metres.
    offset: f32,
}

impl SurfaceHit {
    /// The point with barycentric `weights` in the triangle of `record`.
    #[inline]
    pub(crate) fn new(surface: SurfaceIndex, triangle: TriangleIndex, record: &TriangleRecord, weights: Vec3) -> Self {
        let blend = |[a, b, c]: [Vec3; 3]| a * weights.x + b * weights.y + c * weights.z;
        let shading = if record.smooth { blend(record.normals).try_normalize() } else { None };
        let [a, b, c] = record.uvs;
        Self {
            surface,
            triangle,
            position: blend(record.positions),
            geometric_normal: record.normal,
            shading_normal: shading.filter(|normal| normal.dot(record.normal) > 0.0).unwrap_or(record.normal),
            uv: a * weights.x + b * weights.y + c * weights.z,
            offset: record.offset,
        }
    }

    /// Whether `direction`, away from the surface, leaves on the front.
    #[inline]
    pub fn is_front(&self, direction: Vec3) -> bool {
        self.geometric_normal.dot(direction) > 0.0
    }

    /// A ray from here along `direction` that does not hit this triangle again.
    #[inline]
    pub fn spawn(&self, direction: Vec3) -> Ray {
        Ray::endless(self.beside(direction), direction)
    }

    /// A shadow ray from here to just before `other`, or `None` if both coincide.
    #[inline]
    pub fn spawn_to(&self, other: &SurfaceHit) -> Option<Ray> {
        let towards = other.position - self.position;
        let (from, to) = (self.beside(towards), other.beside(-towards));
        let distance = (to - from).length();
        let direction = (to - from).try_normalize()?;
        Some(Ray::new(from, direction, distance * (1.0 - 4.0 * ROUNDING)))
    }

    /// The point where rays along `direction` start: off the surface, on the side to which they go.
    ///
    /// The offset is a number of roundings, as in Waechter and Binder, "A Fast and Robust Method for Avoiding
    /// Self-Intersection" (Ray Tracing Gems, 2019), so it suits scenes of a millimetre and of a kilometre. Unlike
    /// there, it is relative to the triangle's corners and the size of the scene, since both enter the triangle test,
    /// and not to the hit alone.
    fn beside(&self, direction: Vec3) -> Vec3 {
        let side = if self.is_front(direction) { self.offset } else { -self.offset };
        self.position + self.geometric_normal * side
    }
}

#[cfg(test)]
mod tests {
    use mateval_scene::TriangleMesh;

    use super::*;
    use crate::accel::Accel;

    /// A tilted square with side `size` near (1, 1, 1) * `size`.
    fn square(size: f32) -> TriangleMesh {
        let (u, v) = (Vec3::new(0.6, 0.0, 0.8) * size, Vec3::new(0.48, 0.8, -0.36) * size);
        let origin = Vec3::splat(size);
        TriangleMesh {
            positions: vec![origin, origin + u, origin + u + v, origin + v],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Default::default()
        }
    }

    /// At scales from a millimetre to ten kilometres, rays that leave a plane at any angle never hit it again, and the
    /// offset stays below a hundred-thousandth of the square's side.
    #[test]
    fn spawned_rays_do_not_meet_their_own_plane() {
        for size in [1e-3, 1.0, 1e3, 1e4] {
            let mesh = square(size);
            let accel = Accel::build(&[&mesh]).unwrap();
            let mut left = 0;
            for index in 0..20_000_u32 {
                let [x, y, z, w] = sobol_burley::sample_4d(index, 0, 7);
                let (b, c) = if x + y > 1.0 { (1.0 - x, 1.0 - y) } else { (x, y) };
                let weights = Vec3::new(1.0 - b - c, b, c);
                let triangle = TriangleIndex((index % 2) as usize);
                let record = TriangleRecord::new(&mesh, triangle, 3.0 * size);
                let hit = SurfaceHit::new(SurfaceIndex(0), triangle, &record, weights);
                assert!(hit.offset < 1e-5 * size);
                let frame = crate::frame::Frame::around(hit.geometric_normal);
                // Elevations from a millionth of a radian to a right angle, on both sides.
                let height = libm::powf(10.0, -6.0 * z) * if index % 4 < 2 { 1.0 } else { -1.0 };
                let (sin, cos) = libm::sincosf(w * std::f32::consts::TAU);
                let flat = (1.0 - height * height).sqrt();
                let direction = frame.world_from_local(Vec3::new(cos * flat, sin * flat, height)).normalize();
                // Rounding may turn a grazing direction back into the plane; such a ray may hit it.
                if hit.geometric_normal.as_dvec3().dot(direction.as_dvec3()) * f64::from(height) > 0.0 {
                    left += 1;
                    assert!(!accel.occluded(&hit.spawn(direction)), "{size} {hit:?} {direction}");
                }
            }
            assert!(left > 19_000, "{left}");
        }
    }

    #[test]
    fn vertex_normals_say_where_the_front_is() {
        let mut mesh = square(1.0);
        let by_winding = TriangleRecord::new(&mesh, TriangleIndex(0), 3.0).normal;
        mesh.normals = Some(vec![-by_winding; 4]);
        assert_eq!(TriangleRecord::new(&mesh, TriangleIndex(0), 3.0).normal, -by_winding);
    }

    #[test]
    fn a_bad_vertex_normal_is_replaced() {
        let mut mesh = square(1.0);
        mesh.normals = Some(vec![Vec3::ZERO; 4]);
        let record = TriangleRecord::new(&mesh, TriangleIndex(0), 3.0);
        let hit = SurfaceHit::new(SurfaceIndex(0), TriangleIndex(0), &record, Vec3::splat(1.0 / 3.0));
        assert_eq!(hit.shading_normal, hit.geometric_normal);
    }
}
