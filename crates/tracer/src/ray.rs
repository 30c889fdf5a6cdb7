//! A ray, and the only way to construct one.

use glam::Vec3;

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

    /// The origin.
    #[inline]
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    /// The direction.
    #[inline]
    pub fn direction(&self) -> Vec3 {
        self.direction
    }

    /// The distance beyond which hits do not count, in metres.
    #[inline]
    pub fn max_distance(&self) -> f32 {
        self.max_distance
    }

    /// The point at `distance`.
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
