//! What the scattering models share: sampled directions, the Fresnel reflectance of a smooth boundary, and microfacets.
//!
//! Fresnel's formulas are for unpolarised light (Born and Wolf, "Principles of Optics", sections 1.5 and 14.2). Facets:
//! Walter et al., "Microfacet Models for Refraction through Rough Surfaces" (EGSR 2007), with separable Smith shadowing
//! and masking as in Mitsuba: their density, masking and sampling. All vectors are in the frame whose z is the surface
//! normal.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use mateval_dataset::material::{ConductorIor, Distribution};

use crate::sampling;

/// A sampled direction in the local frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalSample {
    pub(crate) wi: Vec3,
    /// The value with the cosine, over the density.
    pub(crate) weight: Vec3,
    /// Per solid angle; for a delta sample, its probability.
    pub(crate) density: f32,
    /// Whether the direction comes from a delta distribution, which no other way of sampling can find.
    pub(crate) delta: bool,
}

impl LocalSample {
    pub(crate) fn spread(wi: Vec3, value: Vec3, density: f32) -> Self {
        Self { wi, weight: value / density, density, delta: false }
    }

    pub(crate) fn delta(wi: Vec3, weight: Vec3, probability: f32) -> Self {
        Self { wi, weight, density: probability, delta: true }
    }
}

/// The reflectance of a dielectric boundary and the cosine of the refracted direction (0 under total reflection). `cos`
/// (0 to 1) is on the side of the incident light, `eta` is the index of the other side over that of this side.
pub(crate) fn fresnel_dielectric(cos: f32, eta: f32) -> (f32, f32) {
    let sin2_beyond = (1.0 - cos * cos).max(0.0) / (eta * eta);
    if sin2_beyond >= 1.0 {
        return (1.0, 0.0);
    }
    let beyond = (1.0 - sin2_beyond).sqrt();
    let parallel = (eta * cos - beyond) / (eta * cos + beyond);
    let perpendicular = (cos - eta * beyond) / (cos + eta * beyond);
    // At grazing incidence on a boundary without contrast both quotients are 0 / 0; nothing is reflected there.
    let reflected = 0.5 * (parallel * parallel + perpendicular * perpendicular);
    (if reflected.is_nan() { 0.0 } else { reflected }, beyond)
}

/// The reflectance that [`fresnel_dielectric`] returns, for light on the side of the lower index (`eta` of at least 1)
/// and `cos` above 0, with a single division. Cook and Torrance, "A Reflectance Model for Computer Graphics" (1982).
pub(crate) fn fresnel_from_thinner(cos: f32, eta: f32) -> f32 {
    let g = (eta * eta - 1.0 + cos * cos).sqrt();
    let (above, below) = (cos * (g + cos) - 1.0, cos * (g - cos) + 1.0);
    let quotient = (g - cos) / ((g + cos) * below);
    0.5 * quotient * quotient * (above * above + below * below)
}

/// The fraction of uniform light from one side that a smooth dielectric boundary reflects: 2 * integral of F(mu) mu
/// dmu.
pub(crate) fn diffuse_reflectance(eta: f32) -> f32 {
    const STEPS: u32 = 4096;
    let sum: f64 = (0..STEPS)
        .map(|step| {
            let mu = (f64::from(step) + 0.5) / f64::from(STEPS);
            f64::from(fresnel_dielectric(mu as f32, eta).0) * mu
        })
        .sum();
    (2.0 * sum / f64::from(STEPS)) as f32
}

/// The reflectance of a conductor, per channel, for `cos` from 0 to 1.
pub(crate) fn fresnel_conductor(cos: f32, ior: &ConductorIor) -> Vec3 {
    match ior {
        ConductorIor::PerfectMirror => Vec3::ONE,
        ConductorIor::EtaK { eta, k } => {
            Vec3::from_array(std::array::from_fn(|channel| conductor_channel(cos, eta[channel], k[channel])))
        }
    }
}

fn conductor_channel(cos: f32, eta: f32, k: f32) -> f32 {
    if eta == 0.0 {
        // Nothing enters. For k = 0, the limit, the quotients below are 0 / 0.
        return 1.0;
    }
    let (cos2, sin2) = (cos * cos, 1.0 - cos * cos);
    let difference = eta * eta - k * k - sin2;
    let sum = (difference * difference + 4.0 * eta * eta * k * k).sqrt();
    let a = (0.5 * (sum + difference)).max(0.0).sqrt();
    let perpendicular = (sum + cos2 - 2.0 * a * cos) / (sum + cos2 + 2.0 * a * cos);
    let (near, far) = (sum * cos2 + sin2 * sin2, 2.0 * a * cos * sin2);
    let parallel = perpendicular * (near - far) / (near + far);
    0.5 * (perpendicular + parallel)
}

/// (1 - cos)^5, the weight of Schlick's approximation (1994).
pub(crate) fn schlick_weight(cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    x * x * (x * x) * x
}

/// The index of refraction for Disney's `specular`, by F0 = 0.08 * specular. Blender's IOR level has the same meaning.
pub(crate) fn eta_from_specular(specular: f32) -> f32 {
    2.0 / (1.0 - (0.08 * specular.clamp(0.0, 1.0)).sqrt()) - 1.0
}

/// The microfacets of a rough surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facets {
    distribution: Distribution,
    alpha: f32,
}

/// Below this width f32 cannot represent the peak.
const SMALLEST_ALPHA: f32 = 1e-4;

impl Facets {
    /// An `alpha` below 1e-4 is raised to it, as in Mitsuba.
    pub(crate) fn new(distribution: Distribution, alpha: f32) -> Self {
        Self { distribution, alpha: alpha.max(SMALLEST_ALPHA) }
    }

    /// The density of facets with normal `m`, per solid angle of m and per surface area.
    pub(crate) fn density(&self, m: Vec3) -> f32 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        let (flat2, z2) = (m.x * m.x + m.y * m.y, m.z * m.z);
        match self.distribution {
            Distribution::Ggx => {
                let s = flat2 / a2 + z2;
                1.0 / (PI * a2 * s * s)
            }
            Distribution::Beckmann => libm::expf(-flat2 / (z2 * a2)) / (PI * a2 * z2 * z2),
        }
    }

    /// The fraction of facets `m` that is visible from `w` (Smith's G1).
    pub(crate) fn visible(&self, w: Vec3, m: Vec3) -> f32 {
        // A facet seen from its back while the surface is seen from its front is hidden, and the reverse.
        if w.dot(m) * w.z <= 0.0 {
            return 0.0;
        }
        let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        if tan2 == 0.0 {
            return 1.0;
        }
        match self.distribution {
            Distribution::Ggx => 2.0 / (1.0 + (1.0 + self.alpha * self.alpha * tan2).sqrt()),
            Distribution::Beckmann => {
                // The rational approximation of Walter et al., with a relative error under 0.35 %.
                let a = 1.0 / (self.alpha * tan2.sqrt());
                if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
            }
        }
    }

    /// The fraction of facets `m` visible from both directions.
    pub(crate) fn visible_from_both(&self, wo: Vec3, wi: Vec3, m: Vec3) -> f32 {
        self.visible(wo, m) * self.visible(wi, m)
    }

    /// Samples a facet normal for `wo` with z > 0: for GGX among those visible from `wo`, for Beckmann among all.
    pub(crate) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        match self.distribution {
            Distribution::Ggx => self.sample_visible_ggx(wo, u),
            Distribution::Beckmann => self.sample_beckmann(u),
        }
    }

    /// The density of [`Self::sample`] per solid angle of m.
    pub(crate) fn sample_density(&self, wo: Vec3, m: Vec3) -> f32 {
        match self.distribution {
            Distribution::Ggx => self.density(m) * self.visible(wo, m) * wo.dot(m).max(0.0) / wo.z,
            Distribution::Beckmann => self.density(m) * m.z,
        }
    }

    /// Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps" (CGF 2023).
    fn sample_visible_ggx(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let stretched = Vec3::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let z = (1.0 - u[0]) * (1.0 + stretched.z) - stretched.z;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = sampling::circle(u[1]);
        let half = Vec3::new(radius * cos, radius * sin, z) + stretched;
        Vec3::new(self.alpha * half.x, self.alpha * half.y, half.z.max(0.0)).normalize_or(Vec3::Z)
    }

    /// Walter et al., equation 28.
    fn sample_beckmann(&self, u: [f32; 2]) -> Vec3 {
        let tan2 = -self.alpha * self.alpha * libm::logf(1.0 - u[0]);
        let z = 1.0 / (1.0 + tan2).sqrt();
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = sampling::circle(u[1]);
        (Vec2::new(cos, sin) * radius).extend(z)
    }
}

/// Mirrors `w` at the facet normal `m`.
pub(crate) fn reflect(w: Vec3, m: Vec3) -> Vec3 {
    m * (2.0 * w.dot(m)) - w
}

/// D G / (4 cos_o): a facet reflection without its Fresnel term, including the cosine of wi.
pub(crate) fn reflection(facets: &Facets, wo: Vec3, wi: Vec3, m: Vec3) -> f32 {
    facets.density(m) * facets.visible_from_both(wo, wi, m) / (4.0 * wo.z)
}

/// The density per solid angle of wi if a facet visible from `wo` is sampled and reflects it.
pub(crate) fn reflection_density(facets: &Facets, wo: Vec3, wi: Vec3) -> f32 {
    let Some(m) = (wo + wi).try_normalize() else { return 0.0 };
    let cos = wo.dot(m);
    if cos <= 0.0 || wi.z <= 0.0 { 0.0 } else { facets.sample_density(wo, m) / (4.0 * cos) }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;

    #[test]
    fn known_values() {
        // ((1.5 - 1) / (1.5 + 1))^2; and Brewster's angle, where only one polarisation is reflected.
        assert!((fresnel_dielectric(1.0, 1.5).0 - 0.04).abs() < 1e-7);
        let brewster = 1.0 / (1.0_f32 + 1.5 * 1.5).sqrt();
        let expected = 0.5 * ((1.5_f32 * 1.5 - 1.0) / (1.5 * 1.5 + 1.0)).powi(2);
        assert!((fresnel_dielectric(brewster, 1.5).0 - expected).abs() < 1e-6);
        // Total reflection beyond asin(1 / 1.5) = 41.8 degrees.
        assert_eq!(fresnel_dielectric(0.7, 1.0 / 1.5), (1.0, 0.0));
        // Diffuse reflectance of eta 1.5: 0.0918 (Egan and Hilgeman 1973, table).
        assert!((diffuse_reflectance(1.5) - 0.0918).abs() < 2e-4, "{}", diffuse_reflectance(1.5));
    }

    #[test]
    fn one_division_is_enough() {
        for eta in [1.01, 1.5, 3.0] {
            for cos in [1e-3, 0.1, 0.5, 0.9, 1.0] {
                let (found, expected) = (fresnel_from_thinner(cos, eta), fresnel_dielectric(cos, eta).0);
                assert!((found - expected).abs() < 2e-6, "{eta} {cos}: {found} {expected}");
            }
        }
    }

    /// The transmitted fraction is the same from both sides: (1 - R(1/eta)) * eta^2 = 1 - R(eta).
    #[test]
    fn diffuse_reflectance_inside_follows_from_outside() {
        for eta in [1.2_f32, 1.5, 2.4] {
            let (outside, inside) = (diffuse_reflectance(eta), diffuse_reflectance(1.0 / eta));
            assert!(((1.0 - inside) * eta * eta - (1.0 - outside)).abs() < 1e-3, "{eta}");
        }
    }

    #[test]
    fn a_conductor_without_absorption_is_a_dielectric() {
        let glass = ConductorIor::EtaK { eta: [1.5; 3], k: [0.0; 3] };
        for cos in [0.05, 0.3, 0.7, 1.0] {
            assert!((fresnel_conductor(cos, &glass).x - fresnel_dielectric(cos, 1.5).0).abs() < 1e-5, "{cos}");
        }
    }

    #[test]
    fn a_conductor_without_a_real_index_is_a_mirror() {
        for k in [0.0, 0.3, 1.0] {
            let ior = ConductorIor::EtaK { eta: [0.0; 3], k: [k; 3] };
            assert!([0.0, 0.3, 1.0].iter().all(|cos| fresnel_conductor(*cos, &ior) == Vec3::ONE), "{k}");
        }
    }

    #[test]
    fn a_conductor_head_on_has_its_f0() {
        let copper = ConductorIor::EtaK { eta: [0.2004, 0.9240, 1.1022], k: [3.9129, 2.4528, 2.1421] };
        let found = fresnel_conductor(1.0, &copper);
        assert!((found - Vec3::from_array(copper.reflectance_at_normal())).length() < 1e-5);
    }

    /// The areas of the facets, projected onto the surface, add up to its area. Those visible from w, projected along
    /// w, add up to its cosine.
    #[test]
    fn facets_cover_the_surface() {
        for distribution in [Distribution::Ggx, Distribution::Beckmann] {
            for alpha in [0.1, 0.4, 1.0] {
                let facets = Facets::new(distribution, alpha);
                let w = Vec3::new(0.6, 0.0, 0.8);
                let (mut surface, mut seen) = (0.0, 0.0);
                let n = 400;
                for i in 0..n {
                    for j in 0..n {
                        // Squaring the first coordinate concentrates the grid at the peak.
                        let s = (i as f32 + 0.5) / n as f32;
                        let z = 1.0 - s * s;
                        let (sin, cos) = libm::sincosf(TAU * (j as f32 + 0.5) / n as f32);
                        let m = (Vec2::new(cos, sin) * (1.0 - z * z).sqrt()).extend(z);
                        let area = TAU / n as f32 * (2.0 * s / n as f32);
                        surface += f64::from(facets.density(m) * m.z * area);
                        seen += f64::from(facets.density(m) * facets.visible(w, m) * w.dot(m).max(0.0) * area);
                    }
                }
                assert!((surface - 1.0).abs() < 2e-3, "{distribution:?} {alpha} {surface}");
                assert!((seen - 0.8).abs() < 4e-3, "{distribution:?} {alpha} {seen}");
            }
        }
    }
}
