//! Light from infinity: a latitude-longitude map, or constant radiance.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::{Mat3, Vec3};
use mateval_image::{LinearRgb, Texture};

use crate::sampling::{self, Distribution};

/// An environment map, importance-sampled by its brightness.
///
/// In the map's own frame, direction d is looked up at u = atan2(d.x, -d.z) / (2 pi) and v = acos(d.y) / pi from the
/// top, as in Mitsuba's `envmap`. Lookups are bilinear between texel centres at half-integers; u wraps around, v is
/// clamped at the poles. (Mitsuba stretches v so that the first and last rows lie on the poles, a difference of half a
/// texel.)
#[derive(Debug)]
pub(crate) struct EnvironmentMap {
    texture: Texture,
    scale: f32,
    world_from_map: Mat3,
    rows: Distribution,
    columns: Vec<Distribution>,
}

impl EnvironmentMap {
    /// `world_from_map` is row-major.
    pub(crate) fn new(texture: &Texture, scale: f32, world_from_map: [[f32; 3]; 3]) -> Self {
        let luminance = luminances(texture);
        let weight = |x: usize, y: usize| neighbourhood(&luminance, texture, x, y) * f64::from(row_area(texture, y));
        let row = |y: usize| Distribution::new((0..texture.width()).map(|x| weight(x, y)));
        let columns: Vec<Distribution> = (0..texture.height()).map(row).collect();
        Self {
            texture: texture.clone(),
            scale,
            world_from_map: Mat3::from_cols_array_2d(&world_from_map).transpose(),
            rows: Distribution::new(columns.iter().map(Distribution::total)),
            columns,
        }
    }

    /// The radiance from `direction`.
    pub(crate) fn radiance(&self, direction: Vec3) -> Vec3 {
        let [u, v] = self.place(direction);
        let (width, height) = (self.texture.width(), self.texture.height());
        let (x, y) = (u * width as f32 - 0.5, (v * height as f32 - 0.5).clamp(0.0, (height - 1) as f32));
        let (left, top) = (x.floor(), y.floor());
        let (x0, y0) = ((left as i64).rem_euclid(width as i64) as usize, top as usize);
        let (x1, y1) = ((x0 + 1) % width, (y0 + 1).min(height - 1));
        let texel = |x: usize, y: usize| Vec3::from_array(self.texture.texel(x, y));
        let upper = texel(x0, y0).lerp(texel(x1, y0), x - left);
        let lower = texel(x0, y1).lerp(texel(x1, y1), x - left);
        upper.lerp(lower, y - top) * self.scale
    }

    /// Samples a direction; returns it with its density per solid angle.
    pub(crate) fn sample(&self, u: [f32; 2]) -> (Vec3, f32) {
        let (row, v) = self.rows.sample(u[0]);
        let (column, u) = self.columns[row].sample(u[1]);
        let phi = TAU * (column as f32 + u) / self.texture.width() as f32;
        let theta = PI * (row as f32 + v) / self.texture.height() as f32;
        let ((sin_phi, cos_phi), (sin, cos)) = (libm::sincosf(phi), libm::sincosf(theta));
        let direction = self.world_from_map * Vec3::new(sin * sin_phi, cos, -sin * cos_phi);
        (direction, self.texel_density(row, column, sin))
    }

    /// The density of [`Self::sample`].
    pub(crate) fn density(&self, direction: Vec3) -> f32 {
        let [u, v] = self.place(direction);
        let (width, height) = (self.texture.width(), self.texture.height());
        let column = ((u * width as f32) as usize).min(width - 1);
        let row = ((v * height as f32) as usize).min(height - 1);
        let local = self.world_from_map.transpose() * direction;
        self.texel_density(row, column, (local.x * local.x + local.z * local.z).sqrt())
    }

    fn texel_density(&self, row: usize, column: usize, sin_theta: f32) -> f32 {
        let probability = self.rows.probability(row) * self.columns[row].probability(column);
        let texels = (self.texture.width() * self.texture.height()) as f32;
        probability * texels / (TAU * PI * sin_theta.max(f32::MIN_POSITIVE))
    }

    /// The coordinates u and v (from the top) of a direction, both in 0..1.
    fn place(&self, direction: Vec3) -> [f32; 2] {
        let d = self.world_from_map.transpose() * direction;
        let u = libm::atan2f(d.x, -d.z) / TAU;
        [if u < 0.0 { u + 1.0 } else { u }, libm::acosf(d.y.clamp(-1.0, 1.0)) * FRAC_1_PI]
    }
}

fn luminances(texture: &Texture) -> Vec<f64> {
    let texel = |k: usize| LinearRgb(texture.texel(k % texture.width(), k / texture.width()));
    (0..texture.width() * texture.height()).map(|k| texel(k).luminance().max(0.0)).collect()
}

/// The mean over a texel and its neighbours: above zero wherever a bilinear lookup in the texel is.
fn neighbourhood(luminance: &[f64], texture: &Texture, x: usize, y: usize) -> f64 {
    let (width, height) = (texture.width(), texture.height());
    let mut sum = 0.0;
    for row in [y.saturating_sub(1), y, (y + 1).min(height - 1)] {
        for column in [x + width - 1, x, x + 1] {
            sum += luminance[row * width + column % width];
        }
    }
    sum / 9.0
}

/// The solid angle of a row, up to a constant factor.
fn row_area(texture: &Texture, y: usize) -> f32 {
    libm::sinf(PI * (y as f32 + 0.5) / texture.height() as f32)
}

/// A uniform direction and its density.
pub(crate) fn sample_constant(u: [f32; 2]) -> (Vec3, f32) {
    (sampling::sphere(u), CONSTANT_DENSITY)
}

/// The density of [`sample_constant`].
pub(crate) const CONSTANT_DENSITY: f32 = 0.25 * FRAC_1_PI;

#[cfg(test)]
mod tests {
    use mateval_image::{Texels, Wrap};

    use super::*;

    const IDENTITY: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    fn map(bright: usize) -> EnvironmentMap {
        let mut texels = vec![[0.01; 3]; 16 * 8];
        texels[bright] = [100.0; 3];
        let texture = Texture::new(16, 8, Texels::Linear(texels), Wrap::Repeat).unwrap();
        EnvironmentMap::new(&texture, 1.0, IDENTITY)
    }

    #[test]
    fn the_convention_is_mitsubas() {
        // The centre of column 4 of 16 is at u = 4.5 / 16. The direction +X has u = 0.25, the border of columns 3 and
        // 4.
        let map = map(3 * 16 + 4);
        let (phi, theta) = (TAU * 4.5 / 16.0, PI * 3.5 / 8.0);
        let direction = Vec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
        assert!((map.radiance(direction).x - 100.0).abs() < 0.01);
        assert!(map.radiance(Vec3::X).x > 20.0 && map.radiance(-Vec3::X).x < 0.1);
        assert!(map.place(Vec3::X)[0] == 0.25 && map.place(-Vec3::Z)[0] == 0.0 && map.place(Vec3::Y)[1] == 0.0);
    }

    /// The density integrates to one, matches the density that `sample` returns, and is zero nowhere where the map is
    /// not.
    #[test]
    fn density_and_samples_agree() {
        let map = map(0);
        let mut total = 0.0_f64;
        let n = 256;
        for i in 0..n {
            for j in 0..n {
                let (theta, phi) = (PI * (i as f32 + 0.5) / n as f32, TAU * (j as f32 + 0.5) / n as f32);
                let ((sin, cos), (sin_phi, cos_phi)) = (libm::sincosf(theta), libm::sincosf(phi));
                let density = map.density(Vec3::new(sin * cos_phi, cos, sin * sin_phi));
                assert!(density > 0.0);
                total += f64::from(density * sin * PI * TAU) / f64::from(n * n);
            }
        }
        assert!((total - 1.0).abs() < 0.01, "{total}");
        for index in 0..1000 {
            let [a, b, ..] = sobol_burley::sample_4d(index, 0, 5);
            let (direction, density) = map.sample([a, b]);
            assert!((density / map.density(direction) - 1.0).abs() < 1e-2, "{density} {direction}");
        }
    }
}
