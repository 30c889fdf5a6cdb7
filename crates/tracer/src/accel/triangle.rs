//! The ray-triangle test: watertight and double-sided.
//!
//! Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013): vertices are moved into the ray's own
//! sheared space, where the ray is the z axis, and rounded to f32 there. The three edge functions are then computed in
//! f64, in which the products of f32 are exact, so that their signs are exact: two triangles with a common edge agree
//! about the side on which the ray passes, and around a common vertex there is no gap.

use glam::{DVec3, Vec3};

use crate::ray::Ray;

/// What of a ray the triangle test needs, computed once a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    origin: [f32; 3],
    /// The axes x, y, z of the sheared space; z is where the direction is largest.
    axes: [usize; 3],
    shear: [f32; 2],
    /// One over the direction along z.
    distance_from_z: f64,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangleHit {
    pub(crate) distance: f32,
    /// Weights of the three corners.
    pub(crate) barycentrics: Vec3,
}

impl ShearedRay {
    pub(crate) fn new(ray: &Ray) -> Self {
        let d = ray.direction().to_array();
        let size = d.map(f32::abs);
        let z = if size[0] > size[1] && size[0] > size[2] {
            0
        } else if size[1] > size[2] {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        Self {
            origin: ray.origin().to_array(),
            axes: [x, y, z],
            shear: [d[x] / d[z], d[y] / d[z]],
            distance_from_z: 1.0 / f64::from(d[z]),
        }
    }

    /// The triangle's hit at a distance above 0 and up to `max_distance`; none for triangles seen edge-on.
    #[inline]
    pub(crate) fn intersect(&self, corners: &[Vec3; 3], max_distance: f32) -> Option<TriangleHit> {
        let [a, b, c] = corners.map(|corner| self.sheared(corner));
        let u = edge(c, b);
        let v = edge(a, c);
        let w = edge(b, a);
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let sum = u + v + w;
        if sum == 0.0 {
            return None;
        }
        let z = (u * f64::from(a[2]) + v * f64::from(b[2]) + w * f64::from(c[2])) / sum;
        let distance = (z * self.distance_from_z) as f32;
        (distance > 0.0 && distance <= max_distance)
            .then(|| TriangleHit { distance, barycentrics: DVec3::new(u / sum, v / sum, w / sum).as_vec3() })
    }

    #[inline]
    fn sheared(&self, corner: Vec3) -> [f32; 3] {
        let p = corner.to_array();
        let [x, y, z] = self.axes.map(|axis| p[axis] - self.origin[axis]);
        [x - self.shear[0] * z, y - self.shear[1] * z, z]
    }
}

/// Twice the area of the triangle of `p`, `q` and the ray, signed; the sign is exact.
#[inline]
fn edge(p: [f32; 3], q: [f32; 3]) -> f64 {
    f64::from(p[0]) * f64::from(q[1]) - f64::from(p[1]) * f64::from(q[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shoot(origin: Vec3, direction: Vec3, corners: [Vec3; 3]) -> Option<TriangleHit> {
        ShearedRay::new(&Ray::endless(origin, direction)).intersect(&corners, f32::INFINITY)
    }

    #[test]
    fn barycentrics_weigh_the_corners() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        for (origin, direction) in [(Vec3::new(0.5, 0.25, 2.0), -Vec3::Z), (Vec3::new(0.5, 0.25, -2.0), Vec3::Z)] {
            let hit = shoot(origin, direction, corners).unwrap();
            assert_eq!((hit.distance, hit.barycentrics), (2.0, Vec3::new(0.25, 0.5, 0.25)));
        }
    }

    #[test]
    fn edge_on_and_degenerate_triangles_are_missed() {
        assert!(shoot(Vec3::new(-1.0, 0.25, 0.0), Vec3::X, [Vec3::ZERO, Vec3::X, Vec3::Y]).is_none());
        assert!(shoot(Vec3::new(0.5, 0.0, 1.0), -Vec3::Z, [Vec3::ZERO, Vec3::X, Vec3::X * 2.0]).is_none());
        assert!(shoot(Vec3::new(0.0, 0.0, 1.0), -Vec3::Z, [Vec3::ZERO; 3]).is_none());
    }
}
