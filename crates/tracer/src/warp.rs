//! From the unit square to directions.

use std::f32::consts::{FRAC_PI_4, PI, TAU};

use glam::{Vec2, Vec3};

/// A point of the unit disk, uniform. Shirley and Chiu, "A Low Distortion Map Between Disk and Square" (1997).
pub(crate) fn disk(u: [f32; 2]) -> Vec2 {
    let (x, y) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if x == 0.0 && y == 0.0 {
        return Vec2::ZERO;
    }
    let (radius, angle) =
        if x.abs() > y.abs() { (x, FRAC_PI_4 * (y / x)) } else { (y, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (x / y)) };
    let (sin, cos) = libm::sincosf(angle);
    Vec2::new(radius * cos, radius * sin)
}

/// A direction of the upper half, density cos / pi.
pub(crate) fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let p = disk(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}

/// The density of [`cosine_hemisphere`] per solid angle.
pub(crate) fn cosine_density(z: f32) -> f32 {
    z.max(0.0) / PI
}

/// A direction, uniform over the sphere: density 1 / (4 pi).
pub(crate) fn sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = libm::sincosf(TAU * u[1]);
    Vec3::new(radius * cos, radius * sin, z)
}

/// Weights of a triangle's corners, uniform over its area.
pub(crate) fn triangle(u: [f32; 2]) -> Vec3 {
    let root = u[0].sqrt();
    Vec3::new(1.0 - root, root * (1.0 - u[1]), root * u[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosine_hemisphere_has_the_moments_of_its_density() {
        let n = 4096;
        let mean = (0..n).map(|i| cosine_hemisphere(sobol(i))).sum::<Vec3>() / n as f32;
        assert!((mean - Vec3::new(0.0, 0.0, 2.0 / 3.0)).length() < 2e-3, "{mean}");
    }

    #[test]
    fn triangle_weights_average_to_a_third() {
        let n = 4096;
        let mean = (0..n).map(|i| triangle(sobol(i))).sum::<Vec3>() / n as f32;
        assert!((mean - Vec3::splat(1.0 / 3.0)).length() < 2e-3, "{mean}");
    }

    fn sobol(index: u32) -> [f32; 2] {
        let [x, y, ..] = sobol_burley::sample_4d(index, 0, 1);
        [x, y]
    }
}
