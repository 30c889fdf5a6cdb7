//! An orthonormal frame around a normal.

use glam::Vec3;

/// Three orthonormal vectors; z is the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    x: Vec3,
    y: Vec3,
    z: Vec3,
}

impl Frame {
    /// A frame whose z axis is `normal` (unit length). Duff et al., "Building an Orthonormal Basis, Revisited" (JCGT
    /// 2017).
    pub(crate) fn around(normal: Vec3) -> Self {
        let sign = 1.0_f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        let x = Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
        let y = Vec3::new(b, sign + normal.y * normal.y * a, -normal.y);
        Self { x, y, z: normal }
    }

    /// Converts a vector from world space to this frame.
    pub(crate) fn local_from_world(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// Converts a vector from this frame to world space.
    pub(crate) fn world_from_local(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for normal in [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(0.36, -0.48, -0.8), Vec3::new(1e-20, 0.0, -1.0)] {
            let frame = Frame::around(normal);
            assert!((frame.x.cross(frame.y) - normal).length() < 1e-6);
            assert!(frame.x.dot(frame.y).abs() < 1e-6 && (frame.x.length() - 1.0).abs() < 1e-6);
            let v = Vec3::new(0.3, -0.2, 0.7);
            assert!((frame.world_from_local(frame.local_from_world(v)) - v).length() < 1e-6);
        }
    }
}
