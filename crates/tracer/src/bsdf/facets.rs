//! Microfacet distributions: the density of facet normals on a rough surface, masking, and sampling.
//!
//! Walter et al., "Microfacet Models for Refraction through Rough Surfaces" (EGSR 2007), with separable Smith shadowing
//! and masking as in Mitsuba. All vectors are in the frame whose z is the surface normal.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use mateval_scene::material::Distribution;

use crate::sampling;

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

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;

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
