//! A ray, made by one constructor.

use glam::Vec3;

/// Unit vectors stay below it with room to spare.
const LARGEST_DIRECTION: f32 = 1e3;
/// Farther out, f32 could not tell the corners of any scene that is accepted apart; and products stay finite.
const FARTHEST_ORIGIN: f32 = 1e15;

/// A half-line or a piece of one, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    origin: Vec3,
    direction: Vec3,
    max_distance: f32,
    usable: bool,
}

impl Ray {
    /// From `origin` along `direction` (unit length) for `max_distance` metres, which may be infinite.
    ///
    /// The only way to make a ray. It turns negative zeros into zeros. A ray whose direction is zero or not finite, or
    /// whose origin is not finite or beyond 1e15 m, hits nothing.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3, max_distance: f32) -> Self {
        // Infinities and NaN are not below either bound.
        let usable = origin.abs().cmple(Vec3::splat(FARTHEST_ORIGIN)).all()
            && direction.abs().cmple(Vec3::splat(LARGEST_DIRECTION)).all()
            && direction != Vec3::ZERO;
        // -0.0 + 0.0 is +0.0; every other number stays as it is.
        Self { origin: origin + Vec3::ZERO, direction: direction + Vec3::ZERO, max_distance, usable }
    }

    /// From `origin` along `direction`, without end.
    #[inline]
    pub fn endless(origin: Vec3, direction: Vec3) -> Self {
        Self::new(origin, direction, f32::INFINITY)
    }

    /// Where it starts.
    #[inline]
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    /// Where it goes.
    #[inline]
    pub fn direction(&self) -> Vec3 {
        self.direction
    }

    /// Hits beyond this distance do not count, in metres.
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
