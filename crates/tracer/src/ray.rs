//! Rays, what they hit, and the points on surfaces where the next rays start.

use glam::{DVec3, Vec2, Vec3};
use mateval_dataset::TriangleMesh;
use mateval_dataset::reference::SurfaceIndex;

/// Unit vectors stay well below this.
const LARGEST_DIRECTION: f32 = 1e3;
/// Beyond this, f32 could not distinguish the corners of any accepted scene; below it, products stay finite.
const FARTHEST_ORIGIN: f32 = 1e15;

/// A half-line or line segment in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    origin: Vec3,
    direction: Vec3,
    max_distance: f32,
    usable: bool,
}

impl Ray {
    /// A ray from `origin` along `direction` (unit length) for `max_distance` metres, which may be infinite.
    ///
    /// This is the only constructor. It turns negative zeros into zeros. A ray whose direction is zero or not finite,
    /// or whose origin is not finite or beyond 1e15 m, hits nothing.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3, max_distance: f32) -> Self {
        // Infinities and NaN fail both comparisons.
        let usable = origin.abs().cmple(Vec3::splat(FARTHEST_ORIGIN)).all()
            && direction.abs().cmple(Vec3::splat(LARGEST_DIRECTION)).all()
            && direction != Vec3::ZERO;
        // -0.0 + 0.0 is +0.0; every other number is unchanged.
        Self { origin: origin + Vec3::ZERO, direction: direction + Vec3::ZERO, max_distance, usable }
    }

    /// A ray from `origin` along `direction` without end.
    #[inline]
    pub fn endless(origin: Vec3, direction: Vec3) -> Self {
        Self::new(origin, direction, f32::INFINITY)
    }

    #[inline]
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    #[inline]
    pub fn direction(&self) -> Vec3 {
        self.direction
    }

    /// The distance beyond which hits do not count, in metres.
    #[inline]
    pub fn max_distance(&self) -> f32 {
        self.max_distance
    }

    #[inline]
    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }

    /// Whether the ray can hit anything.
    #[inline]
    pub(crate) fn is_usable(&self) -> bool {
        self.usable
    }
}

/// The index of a triangle within the mesh of its surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TriangleIndex(pub usize);

/// An intersection of a ray with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub surface: SurfaceIndex,
    /// The triangle, within that surface's mesh.
    pub triangle: TriangleIndex,
    /// Barycentric weights of the triangle's corners; they add up to 1.
    pub barycentrics: Vec3,
    /// Distance along the ray, in metres.
    pub distance: f32,
    /// The index of the triangle among all triangles, in the order of the surfaces.
    pub(crate) global: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
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
    pub(crate) fn is_front(&self, direction: Vec3) -> bool {
        self.geometric_normal.dot(direction) > 0.0
    }

    /// A ray from here along `direction` that does not hit this triangle again.
    #[inline]
    pub fn spawn(&self, direction: Vec3) -> Ray {
        Ray::endless(self.beside(direction), direction)
    }

    /// A shadow ray from here to just before `other`, or `None` if both coincide.
    #[inline]
    pub(crate) fn spawn_to(&self, other: &SurfaceHit) -> Option<Ray> {
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

/// 2^-24, half the spacing of f32 at 1.
pub(crate) const ROUNDING: f32 = 1.0 / (1 << 24) as f32;

/// The data of a triangle that shading reads, its corners and what is constant over it, in one record of 128 bytes: a
/// hit touches two cache lines instead of twelve.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct TriangleRecord {
    pub(crate) positions: [Vec3; 3],
    /// [`crate::SurfaceHit::geometric_normal`].
    pub(crate) normal: Vec3,
    /// The distance from the triangle at which rays start so that they do not hit it again, in metres.
    pub(crate) offset: f32,
    /// Zero if the mesh has no uvs.
    pub(crate) uvs: [Vec2; 3],
    /// Vertex normals, if `smooth`.
    pub(crate) normals: [Vec3; 3],
    pub(crate) smooth: bool,
}

impl TriangleRecord {
    /// The record of a triangle of `mesh`. `scene_size` is the largest absolute coordinate of the scene.
    pub(crate) fn new(mesh: &TriangleMesh, triangle: TriangleIndex, scene_size: f32) -> Self {
        let vertices = mesh.triangles[triangle.0].map(|vertex| vertex as usize);
        let positions = mesh.corners(triangle.0);
        let [a, b, c] = positions.map(|corner| corner.as_dvec3());
        let by_winding = (b - a).cross(c - a).try_normalize().unwrap_or(DVec3::Z).as_vec3();
        let normals = mesh.normals.as_ref().map(|normals| vertices.map(|vertex| normals[vertex]));
        let turned = normals.is_some_and(|normals| normals.into_iter().sum::<Vec3>().dot(by_winding) < 0.0);
        Self {
            positions,
            normal: if turned { -by_winding } else { by_winding },
            offset: offset(positions, scene_size),
            uvs: mesh.uvs.as_ref().map_or([Vec2::ZERO; 3], |uvs| vertices.map(|vertex| uvs[vertex])),
            smooth: normals.is_some(),
            normals: normals.unwrap_or_default(),
        }
    }
}

/// A hit is off its triangle by 6 roundings of the corners' coordinates (3 of the weights, 3 of their sum), times the
/// square root of 3 where the triangle is oblique. The next ray's triangle test moves corners by 6 roundings of
/// distances of up to twice the coordinates, along two axes. The sum rounds once per axis. Together that is 10.4 + 17 +
/// 1.7 roundings; 40 leaves a margin. The second term is for a neighbour in the same plane, which may be as large as
/// the scene.
fn offset(corners: [Vec3; 3], scene_size: f32) -> f32 {
    let largest = corners.iter().fold(0.0_f32, |size, corner| size.max(corner.abs().max_element()));
    ROUNDING * (40.0 * largest + 4.0 * scene_size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Accel;

    #[test]
    fn negative_zero_becomes_zero() {
        let ray = Ray::endless(Vec3::new(-0.0, 1.0, -0.0), Vec3::new(-0.0, -0.0, -1.0));
        for value in ray.origin().to_array().into_iter().chain(ray.direction().to_array()) {
            assert!(value != 0.0 || value.is_sign_positive());
        }
        assert_eq!(ray.direction().z, -1.0);
    }

    /// A tilted square with side `size` near (1, 1, 1) * `size`.
    fn square(size: f32) -> TriangleMesh {
        let (u, v) = (Vec3::new(0.6, 0.0, 0.8) * size, Vec3::new(0.48, 0.8, -0.36) * size);
        mateval_testkit::scenes::quad(Vec3::splat(size), u, v)
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
                let frame = crate::sampling::Frame::around(hit.geometric_normal);
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

    #[test]
    fn a_record_fills_two_cache_lines() {
        assert_eq!((size_of::<TriangleRecord>(), align_of::<TriangleRecord>()), (128, 64));
    }
}
