//! The coat of rough plastic: tables of the light that passes it, integrated at start-up.
//!
//! The coat is a rough dielectric boundary: one bounce at the facets with Smith masking on both sides. Light that hits
//! a second facet is neither reflected nor transmitted here, so both together are below one for rough boundaries.

use glam::Vec3;
use mateval_dataset::material::Distribution;

use super::facets::{Facets, fresnel_dielectric, reflect};

/// The coat of rough plastic: the light transmitted into it, and the light it reflects back inside.
#[derive(Clone, Debug)]
pub(crate) struct RoughCoat {
    widths: Widths,
    transmitted: Vec<Row>,
    /// The fraction of uniform light from inside that is reflected back inside.
    inside: Vec<f32>,
}

/// The facet widths of a table: a single one, or many spaced evenly in perceptual roughness.
#[derive(Clone, Debug)]
pub(crate) struct Widths(Vec<f32>);

/// Entry k belongs to the cosine [`cosine`] of k.
type Row = [f32; COSINES];

const COSINES: usize = 64;
/// Facets are integrated over a grid with this many points along each side.
const GRID: u32 = 32;
/// The same for reflection from inside, where total reflection causes a sharp edge.
const FINE_GRID: u32 = 64;
/// The number of widths in a table for varying width.
const WIDTHS: usize = 24;

impl Widths {
    /// For a width that is constant over the surface.
    pub(crate) fn uniform(alpha: f32) -> Self {
        Self(vec![alpha])
    }

    /// For any width from 0 to 1.
    pub(crate) fn varying() -> Self {
        Self(
            (0..WIDTHS)
                .map(|step| {
                    let x = step as f32 / (WIDTHS - 1) as f32;
                    x * x
                })
                .collect(),
        )
    }

    /// Interpolates `at` between the two table entries around the width `alpha`.
    fn interpolate(&self, alpha: f32, at: impl Fn(usize) -> f32) -> f32 {
        if self.0.len() == 1 {
            return at(0);
        }
        let position = alpha.clamp(0.0, 1.0).sqrt() * (WIDTHS - 1) as f32;
        let lower = (position as usize).min(WIDTHS - 2);
        at(lower) + (position - lower as f32) * (at(lower + 1) - at(lower))
    }

    fn rows(&self, distribution: Distribution, share: impl Fn(&Facets, f32) -> f32) -> Vec<Row> {
        let row = |&alpha: &f32| {
            let facets = Facets::new(distribution, alpha);
            std::array::from_fn(|k| share(&facets, cosine(k).max(1e-6)))
        };
        self.0.iter().map(row).collect()
    }
}

impl RoughCoat {
    pub(crate) fn new(distribution: Distribution, eta: f32, widths: Widths) -> Self {
        let transmitted = widths.rows(distribution, |facets, cos| transmitted_share(facets, eta, cos));
        let inside = widths.0.iter().map(|&alpha| uniform_reflected(&Facets::new(distribution, alpha), 1.0 / eta));
        Self { transmitted, inside: inside.collect(), widths }
    }

    /// The transmitted fraction of light from outside that arrives from the cosine `cos`.
    pub(crate) fn transmitted(&self, cos: f32, alpha: f32) -> f32 {
        self.widths.interpolate(alpha, |row| look_up_cosine(&self.transmitted[row], cos))
    }

    /// The fraction of uniform light from inside that is reflected back inside.
    pub(crate) fn reflected_inside(&self, alpha: f32) -> f32 {
        self.widths.interpolate(alpha, |row| self.inside[row])
    }
}

/// Entries are closer together towards grazing angles, where reflection rises steeply.
fn cosine(k: usize) -> f32 {
    let root = k as f32 / (COSINES - 1) as f32;
    root * root
}

fn look_up_cosine(row: &Row, cos: f32) -> f32 {
    let position = cos.clamp(0.0, 1.0).sqrt() * (COSINES - 1) as f32;
    let cell = (position as usize).min(COSINES - 2);
    row[cell] + (position - cell as f32) * (row[cell + 1] - row[cell])
}

/// The reflected fraction of uniform light, 2 * integral of f(mu) mu dmu, summed as Mitsuba does: over 64 evenly spaced
/// cosines, with full weight at both ends. For an index of 1 / 1.5 the sum is 1.5 % below the integral. `roughplastic`
/// includes that error, which makes a white base 1.3 % darker.
fn uniform_reflected(facets: &Facets, eta: f32) -> f32 {
    let term = |k: usize| {
        let cos = k as f32 / (COSINES - 1) as f32;
        cos * reflected_share(facets, eta, cos.max(1e-6), FINE_GRID)
    };
    2.0 * (0..COSINES).map(term).sum::<f32>() / COSINES as f32
}

/// The fraction of light from the cosine `cos` that facets reflect upwards.
fn reflected_share(facets: &Facets, eta: f32, cos: f32, grid: u32) -> f32 {
    over_facets(facets, cos, grid, |wo, m| {
        let wi = reflect(wo, m);
        let share = fresnel_dielectric(wo.dot(m), eta).0;
        if wi.z > 0.0 { share * facets.visible(wi, m) } else { 0.0 }
    })
}

/// The fraction of light from the cosine `cos` that facets transmit downwards.
fn transmitted_share(facets: &Facets, eta: f32, cos: f32) -> f32 {
    over_facets(facets, cos, GRID, |wo, m| {
        let (reflected, beyond) = fresnel_dielectric(wo.dot(m), eta);
        let wi = m * (wo.dot(m) / eta - beyond) - wo / eta;
        if wi.z < 0.0 { (1.0 - reflected) * facets.visible(wi, m) } else { 0.0 }
    })
}

/// The mean of `value(wo, m)` over the facets m visible from wo at the cosine `cos`.
fn over_facets(facets: &Facets, cos: f32, grid: u32, value: impl Fn(Vec3, Vec3) -> f32) -> f32 {
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0_f64;
    for i in 0..grid {
        for j in 0..grid {
            let m = facets.sample(wo, [i, j].map(|k| (k as f32 + 0.5) / grid as f32));
            let density = facets.sample_density(wo, m);
            if wo.dot(m) > 0.0 && density > 0.0 {
                let seen = facets.density(m) * facets.visible(wo, m) * wo.dot(m) / wo.z;
                sum += f64::from(value(wo, m) * seen / density);
            }
        }
    }
    (sum / f64::from(grid * grid)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::facets::diffuse_reflectance;

    #[test]
    fn a_nearly_smooth_boundary_does_what_fresnel_says() {
        let coat = RoughCoat::new(Distribution::Ggx, 1.5, Widths::uniform(1e-3));
        for cos in [0.3, 0.6, 1.0] {
            let expected = fresnel_dielectric(cos, 1.5).0;
            assert!((coat.transmitted(cos, 1e-3) - (1.0 - expected)).abs() < 2e-3, "{cos}");
        }
        // The error of Mitsuba's sum, 1.5 %.
        assert!((coat.reflected_inside(1e-3) / diffuse_reflectance(1.0 / 1.5) - 0.985).abs() < 3e-3);
    }

    #[test]
    fn the_table_over_widths_agrees_with_one_made_for_a_width() {
        let varying = RoughCoat::new(Distribution::Ggx, 1.5, Widths::varying());
        for alpha in [0.04, 0.21, 0.7] {
            let exact = RoughCoat::new(Distribution::Ggx, 1.5, Widths::uniform(alpha));
            for cos in [0.1, 0.4, 0.9] {
                assert!(
                    (varying.transmitted(cos, alpha) - exact.transmitted(cos, alpha)).abs() < 2e-3,
                    "{alpha} {cos}"
                );
            }
        }
    }

    /// Computed from values of Mitsuba 3.9.1's `roughplastic` (GGX, alpha 0.3, eta 1.5).
    #[test]
    fn a_rough_coat_is_mitsubas() {
        let coat = RoughCoat::new(Distribution::Ggx, 1.5, Widths::uniform(0.3));
        for (cos, expected) in [(0.1, 0.7144), (0.3, 0.8177), (0.5, 0.8865), (0.8, 0.9393), (1.0, 0.9532)] {
            assert!((coat.transmitted(cos, 0.3) - expected).abs() < 3e-3, "{cos} {}", coat.transmitted(cos, 0.3));
        }
        assert!((coat.reflected_inside(0.3) - 0.4148).abs() < 3e-3, "{}", coat.reflected_inside(0.3));
    }
}
