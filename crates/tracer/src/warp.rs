//! Maps random numbers to points on disk, sphere, hemisphere and triangle.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, TAU};

use glam::{Vec2, Vec3};

/// A uniform point of the unit disk. Shirley and Chiu, "A Low Distortion Map Between Disk and Square" (1997).
pub(crate) fn disk(u: [f32; 2]) -> Vec2 {
    let (x, y) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if x == 0.0 && y == 0.0 {
        return Vec2::ZERO;
    }
    if x.abs() > y.abs() {
        let (sin, cos) = sin_cos_near_zero(FRAC_PI_4 * (y / x));
        Vec2::new(x * cos, x * sin)
    } else {
        let (sin, cos) = sin_cos_near_zero(FRAC_PI_4 * (x / y));
        Vec2::new(y * sin, y * cos)
    }
}

/// Sine and cosine of `turns` (0 to 1) full turns. Computed from sums and products only, so every machine gets the same
/// bits, in a third of the time of the general functions.
pub(crate) fn circle(turns: f32) -> (f32, f32) {
    // The nearest quarter turn; the remainder is exact.
    let quarter = (4.0 * turns + 0.5) as u32;
    let (sin, cos) = sin_cos_near_zero(TAU * (turns - 0.25 * quarter as f32));
    match quarter & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// Taylor series for angles of up to an eighth of a turn, where the truncation error is below the rounding of f32.
fn sin_cos_near_zero(angle: f32) -> (f32, f32) {
    let x2 = angle * angle;
    let sin = 1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 + x2 / 362_880.0)));
    let cos = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 / 40_320.0)));
    (angle * sin, cos)
}

/// A direction of the upper hemisphere with density cos / pi.
pub(crate) fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let p = disk(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}

/// The density of [`cosine_hemisphere`] per solid angle.
pub(crate) fn cosine_density(z: f32) -> f32 {
    z.max(0.0) * FRAC_1_PI
}

/// A uniform direction with density 1 / (4 pi).
pub(crate) fn sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = circle(u[1]);
    Vec3::new(radius * cos, radius * sin, z)
}

/// Barycentric weights of a uniform point in a triangle.
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

    #[test]
    fn a_turn_goes_round() {
        for step in 0..=4000 {
            let turns = step as f32 / 4000.0;
            let (sin, cos) = circle(turns);
            let angle = std::f64::consts::TAU * f64::from(turns);
            assert!((f64::from(sin) - libm::sin(angle)).abs() < 2e-7, "{turns}");
            assert!((f64::from(cos) - libm::cos(angle)).abs() < 2e-7, "{turns}");
        }
    }

    fn sobol(index: u32) -> [f32; 2] {
        let [x, y, ..] = sobol_burley::sample_4d(index, 0, 1);
        [x, y]
    }
}
