//! What a rough dielectric boundary reflects in all directions together, integrated by us.

use glam::Vec3;
use mateval_scene::material::Distribution;

use super::facets::{Facets, reflect};
use super::fresnel;

/// Directional albedo of a boundary's reflection, tabulated over the cosine of the viewer and the facets' width.
#[derive(Clone, Debug)]
pub(crate) struct RoughBoundary {
    /// Rising.
    alphas: Vec<f32>,
    /// For each alpha, at the cosines of [`cosine`].
    reflected: Vec<[f32; COSINES]>,
    /// For each alpha, the reflected share of uniform light from inside.
    inside: Vec<f32>,
}

const COSINES: usize = 64;
/// Facets integrated over are a grid of this side.
const GRID: u32 = 32;
/// For alphas that vary over the surface.
const ALPHAS: usize = 16;

impl RoughBoundary {
    /// For a width that is the same everywhere.
    pub(crate) fn uniform(distribution: Distribution, eta: f32, alpha: f32) -> Self {
        Self::over(distribution, eta, vec![alpha])
    }

    /// For any width from 0 to 1, interpolated between 16 that are spaced evenly in perceptual roughness.
    pub(crate) fn varying(distribution: Distribution, eta: f32) -> Self {
        let alpha = |step: usize| (step as f32 / (ALPHAS - 1) as f32).powi(2);
        Self::over(distribution, eta, (0..ALPHAS).map(alpha).collect())
    }

    fn over(distribution: Distribution, eta: f32, alphas: Vec<f32>) -> Self {
        let table = |eta: f32| -> Vec<[f32; COSINES]> {
            let at = |&alpha: &f32| {
                let facets = Facets::new(distribution, alpha);
                std::array::from_fn(|k| albedo(&facets, eta, cosine(k).max(1e-6)))
            };
            alphas.iter().map(at).collect()
        };
        let inside = table(1.0 / eta).iter().map(cosine_mean).collect();
        Self { reflected: table(eta), inside, alphas }
    }

    /// The share of light reflected towards (or from) the cosine `cos`.
    pub(crate) fn reflected(&self, cos: f32, alpha: f32) -> f32 {
        let (row, weight) = self.row(alpha);
        let lower = lookup(&self.reflected[row], cos);
        if weight == 0.0 { lower } else { lower + weight * (lookup(&self.reflected[row + 1], cos) - lower) }
    }

    /// The share of uniform light from inside that is reflected back inside.
    pub(crate) fn reflected_inside(&self, alpha: f32) -> f32 {
        let (row, weight) = self.row(alpha);
        let lower = self.inside[row];
        if weight == 0.0 { lower } else { lower + weight * (self.inside[row + 1] - lower) }
    }

    fn row(&self, alpha: f32) -> (usize, f32) {
        if self.alphas.len() == 1 {
            return (0, 0.0);
        }
        let position = alpha.clamp(0.0, 1.0).sqrt() * (ALPHAS - 1) as f32;
        let row = (position as usize).min(ALPHAS - 2);
        (row, position - row as f32)
    }
}

/// Entry k is at this cosine: closer together towards grazing, where reflection rises steeply.
fn cosine(k: usize) -> f32 {
    let root = k as f32 / (COSINES - 1) as f32;
    root * root
}

fn lookup(row: &[f32; COSINES], cos: f32) -> f32 {
    let position = cos.clamp(0.0, 1.0).sqrt() * (COSINES - 1) as f32;
    let cell = (position as usize).min(COSINES - 2);
    row[cell] + (position - cell as f32) * (row[cell + 1] - row[cell])
}

/// Twice the integral of f(mu) mu dmu, trapezoids.
fn cosine_mean(row: &[f32; COSINES]) -> f32 {
    let part = |k: usize| {
        let (a, b) = (cosine(k), cosine(k + 1));
        (row[k] * a + row[k + 1] * b) * (b - a)
    };
    (0..COSINES - 1).map(part).sum()
}

/// The share of light from the cosine `cos` that facets with Fresnel's reflection send anywhere upwards.
fn albedo(facets: &Facets, eta: f32, cos: f32) -> f32 { albedo_n(facets, eta, cos, GRID) }
fn albedo_n(facets: &Facets, eta: f32, cos: f32, grid: u32) -> f32 {
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0_f64;
    for i in 0..grid {
        for j in 0..grid {
            let u = [i, j].map(|k| (k as f32 + 0.5) / grid as f32);
            let m = facets.sample(wo, u);
            let wi = reflect(wo, m);
            let density = facets.sample_density(wo, m);
            if wi.z > 0.0 && wo.dot(m) > 0.0 && density > 0.0 {
                let seen = facets.density(m) * facets.visible_from_both(wo, wi, m) * wo.dot(m) / wo.z;
                sum += f64::from(fresnel::dielectric(wo.dot(m), eta).0 * seen / density);
            }
        }
    }
    (sum / f64::from(grid * grid)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_nearly_smooth_boundary_has_fresnels_reflectance() {
        let table = RoughBoundary::uniform(Distribution::Ggx, 1.5, 1e-3);
        for cos in [0.3, 0.6, 1.0] {
            assert!((table.reflected(cos, 1e-3) - fresnel::dielectric(cos, 1.5).0).abs() < 2e-3, "{cos}");
        }
        assert!((table.reflected_inside(1e-3) - fresnel::diffuse_reflectance(1.0 / 1.5)).abs() < 2e-3);
    }

    #[test]
    fn dbg_alb() {
        for g in [32, 64, 128, 256] { for (a, c) in [(0.01, 0.08), (0.3, 0.08), (0.8, 0.3), (0.01, 0.5), (0.0044444, 0.08), (0.01778, 0.08)] {
            let f = Facets::new(Distribution::Ggx, a); let b = Facets::new(Distribution::Beckmann, a);
            eprintln!("DBG {g} {a} {c} {} {} in {} {}", albedo_n(&f, 1.5, c, g), albedo_n(&b, 1.5, c, g), albedo_n(&f, 1.0/1.5, c, g), albedo_n(&b, 1.0/1.5, c, g));
        } }
        let v = RoughBoundary::varying(Distribution::Ggx, 1.5); let u = RoughBoundary::uniform(Distribution::Ggx, 1.5, 0.01);
        eprintln!("DBG var {} uni {}", v.reflected(0.08, 0.01), u.reflected(0.08, 0.01));
    }
    #[test]
    fn the_table_over_widths_agrees_with_one_made_for_a_width() {
        let varying = RoughBoundary::varying(Distribution::Ggx, 1.5);
        for alpha in [0.04, 0.21, 0.7] {
            let exact = RoughBoundary::uniform(Distribution::Ggx, 1.5, alpha);
            for cos in [0.1, 0.4, 0.9] {
                assert!((varying.reflected(cos, alpha) - exact.reflected(cos, alpha)).abs() < 4e-3, "{alpha} {cos}");
            }
        }
    }
}
