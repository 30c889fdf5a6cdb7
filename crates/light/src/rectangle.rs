//! Rectangles in space: their corners, whether a camera's picture contains any of them, and quads that emit light.

use glam::DVec3;
use mateval_scene::{Camera, TriangleMesh};
use mateval_tracer::StageLight;

/// A corner and two sides that are orthogonal to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rectangle {
    pub(crate) corner: DVec3,
    pub(crate) sides: [DVec3; 2],
}

impl Rectangle {
    /// The rectangle with these sides around `middle`.
    pub(crate) fn around(middle: DVec3, sides: [DVec3; 2]) -> Self {
        Self { corner: middle - (sides[0] + sides[1]) / 2.0, sides }
    }

    /// The unit normal on the side of `place`.
    pub(crate) fn normal_towards(&self, place: DVec3) -> DVec3 {
        let normal = self.sides[0].cross(self.sides[1]).normalize_or_zero();
        if normal.dot(place - self.corner) < 0.0 { -normal } else { normal }
    }

    fn corners(&self) -> [DVec3; 4] {
        let Self { corner, sides: [u, v] } = *self;
        [corner, corner + u, corner + u + v, corner + v]
    }

    /// A light of radiance 1 whose front is on the side of `normal`.
    pub(crate) fn facing(&self, normal: DVec3) -> StageLight {
        let turned = self.sides[0].cross(self.sides[1]).dot(normal) < 0.0;
        let positions = self.corners().map(|corner| corner.as_vec3()).to_vec();
        let triangles = if turned { vec![[0, 2, 1], [0, 3, 2]] } else { vec![[0, 1, 2], [0, 2, 3]] };
        let mesh = TriangleMesh { positions, triangles, ..Default::default() };
        StageLight { mesh, radiance: [1.0; 3] }
    }

    /// Whether any of the rectangle is in the camera's picture, occlusion aside: clips the rectangle at each side of the
    /// picture (Sutherland and Hodgman, "Reentrant polygon clipping", CACM 1974) and checks that something remains.
    pub(crate) fn meets_frustum(&self, camera: &Camera) -> bool {
        let mut polygon = self.corners().to_vec();
        for plane in frustum(camera) {
            let inside = |place: DVec3| plane.dot(place - camera.position());
            let mut rest = Vec::new();
            for (k, &to) in polygon.iter().enumerate() {
                let from = polygon[(k + polygon.len() - 1) % polygon.len()];
                let (a, b) = (inside(from), inside(to));
                if (a < 0.0) != (b < 0.0) {
                    rest.push(from + (to - from) * (a / (a - b)));
                }
                if b >= 0.0 {
                    rest.push(to);
                }
            }
            polygon = rest;
        }
        !polygon.is_empty()
    }
}

/// Whether `place` projects into the camera's picture, occlusion aside.
pub(crate) fn is_in_picture(camera: &Camera, place: DVec3) -> bool {
    frustum(camera).iter().all(|plane| plane.dot(place - camera.position()) >= 0.0)
}

/// The direction in which the camera looks.
pub(crate) fn forward(camera: &Camera) -> DVec3 {
    -camera.rotation().z_axis
}

/// Inward normals of the four planes through the camera's position and the sides of its picture.
fn frustum(camera: &Camera) -> [DVec3; 4] {
    let k = camera.intrinsics;
    let (width, height) = (f64::from(k.width), f64::from(k.height));
    let sides = [
        // Left, right, top, bottom: a point is inside where x / depth is at least (0 - cx) / fx, and so on.
        DVec3::new(k.fx, 0.0, -k.cx),
        DVec3::new(-k.fx, 0.0, -(width - k.cx)),
        DVec3::new(0.0, -k.fy, -k.cy),
        DVec3::new(0.0, k.fy, -(height - k.cy)),
    ];
    sides.map(|side| camera.rotation() * side)
}

#[cfg(test)]
mod tests {
    use mateval_scene::Intrinsics;

    use super::*;

    #[test]
    fn a_rectangle_meets_the_frustum_exactly_up_to_its_edge() {
        let intrinsics = Intrinsics::from_fov_x(320, 180, 60_f64.to_radians());
        let camera =
            Camera::look_at(DVec3::new(2.0, 1.2, 5.5), DVec3::new(2.0, 1.2, 0.0), DVec3::Y, intrinsics).unwrap();
        // At depth 5 the picture reaches 5 tan 30 = 2.887 to each side.
        let beside = |x: f64| Rectangle { corner: DVec3::new(2.0 + x, 1.0, 0.5), sides: [DVec3::X, DVec3::Y * 0.1] };
        assert!(beside(2.88).meets_frustum(&camera) && !beside(2.89).meets_frustum(&camera));
        // Larger than the picture, with every corner outside.
        let large = Rectangle { corner: DVec3::new(-50.0, -50.0, 0.5), sides: [DVec3::X * 100.0, DVec3::Y * 100.0] };
        assert!(large.meets_frustum(&camera));
        let behind = Rectangle { corner: DVec3::new(2.0, 1.0, 5.6), sides: [DVec3::X * 0.1, DVec3::Y * 0.1] };
        assert!(!behind.meets_frustum(&camera));
    }
}
