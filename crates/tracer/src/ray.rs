//! A ray, made by one constructor.

use glam::Vec3;

/// A half-line or a piece of one, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    origin: Vec3,
    direction: Vec3,
    max_distance: f32,
}

impl Ray {
    /// From `origin` along `direction` (unit length) for `max_distance` metres, which may be infinite.
    ///
    /// The only way to make a ray. It turns negative zeros into zeros. A ray whose direction is zero or not finite, or
    /// whose origin is not finite, hits nothing.
    pub fn new(origin: Vec3, direction: Vec3, max_distance: f32) -> Self {
        // -0.0 + 0.0 is +0.0; every other number stays as it is.
        Self { origin: origin + Vec3::ZERO, direction: direction + Vec3::ZERO, max_distance }
    }

    /// From `origin` along `direction`, without end.
    pub fn endless(origin: Vec3, direction: Vec3) -> Self {
        Self::new(origin, direction, f32::INFINITY)
    }

    /// Where it starts.
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    /// Where it goes.
    pub fn direction(&self) -> Vec3 {
        self.direction
    }

    /// Hits beyond this distance do not count, in metres.
    pub fn max_distance(&self) -> f32 {
        self.max_distance
    }

    /// The point at `distance`.
    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }

    /// Whether the ray can hit anything.
    pub(crate) fn is_usable(&self) -> bool {
        self.origin.is_finite() && self.direction.is_finite() && self.direction != Vec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn negative_zero_becomes_zero() {
        let ray = Ray::endless(Vec3::new(-0.0, 1.0, -0.0), Vec3::new(-0.0, -0.0, -1.0));
        for value in ray.origin().to_array().into_iter().chain(ray.direction().to_array()) {
            assert!(value != 0.0 || value.is_sign_positive());
        }
        assert_eq!(ray.direction().z, -1.0);
    }
}
