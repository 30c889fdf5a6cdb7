//! Sets of rays through a scene.

use glam::{DVec2, Vec3};
use mateval_scene::Camera;
use mateval_tracer::{Accel, Ray};

/// Unstratified numbers in [0, 1), four per ray.
fn random(index: u32, stream: u32) -> [f32; 4] {
    sobol_burley::sample_4d(index & 0xffff, 0, (index >> 16) ^ (stream << 20))
}

/// Camera rays through the pixel centres of `camera`, row by row.
pub fn coherent(camera: &Camera) -> Vec<Ray> {
    let [width, height] = [camera.intrinsics.width, camera.intrinsics.height];
    let ray = |x: u32, y: u32| {
        let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        Ray::endless(camera.position().as_vec3(), camera.direction(place).as_vec3())
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| ray(x, y)).collect()
}

/// Rays from uniform points in the scene's box, in uniform directions.
pub fn uniform(accel: &Accel, count: u32) -> Vec<Ray> {
    let [low, high] = accel.bounds();
    let ray = |index: u32| {
        let [x, y, z, _] = random(index, 1);
        Ray::endless(low + (high - low) * Vec3::new(x, y, z), sphere(random(index, 2)))
    };
    (0..count).map(ray).collect()
}

/// Rays from the hits of `rays` into the half-space that each ray came from.
pub fn bounced(accel: &Accel, rays: &[Ray]) -> Vec<Ray> {
    let bounce = |(index, ray): (usize, &Ray)| {
        let hit = accel.closest(ray)?;
        let direction = (sphere(random(index as u32, 3)) - ray.direction()).try_normalize()?;
        Some(Ray::endless(ray.at(hit.distance - 1e-3), direction))
    };
    rays.iter().enumerate().filter_map(bounce).collect()
}

/// Rays from the hits of `rays` to a point below the top of the scene's box, by a tenth of its height.
pub fn towards_ceiling(accel: &Accel, rays: &[Ray], up: Vec3) -> Vec<Ray> {
    let [low, high] = accel.bounds();
    let shadow = |(index, ray): (usize, &Ray)| {
        let from = ray.at(accel.closest(ray)?.distance - 1e-3);
        let [x, y, z, _] = random(index as u32, 4);
        let inside = low + (high - low) * (Vec3::splat(0.1) + Vec3::new(x, y, z) * 0.8);
        let lamp = inside + up * (high.dot(up) - 0.1 * (high - low).dot(up) - inside.dot(up));
        let towards = lamp - from;
        Some(Ray::new(from, towards.try_normalize()?, towards.length()))
    };
    rays.iter().enumerate().filter_map(shadow).collect()
}

/// The same rays, each limited to `reach` metres.
pub fn shortened(rays: &[Ray], reach: f32) -> Vec<Ray> {
    rays.iter().map(|ray| Ray::new(ray.origin(), ray.direction(), reach)).collect()
}

fn sphere([a, b, ..]: [f32; 4]) -> Vec3 {
    let z = 1.0 - 2.0 * a;
    let (sin, cos) = libm::sincosf(std::f32::consts::TAU * b);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}
