//! A diffuse base under a dielectric coat, smooth or rough: Mitsuba's `plastic` and `roughplastic`.
//!
//! Light enters through the coat, is scattered by the base, is reflected back by the coat any number of times and
//! leaves: T(wi) T(wo) / eta^2 * base / (1 - base * R_inside) / pi (Mitsuba 3's documentation of `plastic`). Without
//! `nonlinear`, the denominator does not contain the colour of the base.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::conductor::{reflection, reflection_density};
use crate::bsdf::facets::{Facets, reflect};
use crate::bsdf::fresnel;
use crate::bsdf::rough_boundary::RoughCoat;
use crate::bsdf::sample::LocalSample;
use crate::sampling;

/// The coat and its base at one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plastic<'w> {
    pub(crate) eta: f32,
    pub(crate) nonlinear: bool,
    pub(crate) base: Vec3,
    pub(crate) tint: Vec3,
    pub(crate) coat: Coat<'w>,
}

/// The coat's boundary.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Coat<'w> {
    /// `inside` is the fraction of uniform light from inside that the coat reflects back.
    Smooth { inside: f32 },
    /// `table` holds the directional albedos of the facets.
    Rough { facets: Facets, alpha: f32, table: &'w RoughCoat },
}

impl Plastic<'_> {
    /// The fraction of light that the coat transmits from or to the cosine `cos`. It is also the probability of
    /// sampling the base, so that the choice does not depend on colours.
    fn transmitted(&self, cos: f32) -> f32 {
        match self.coat {
            Coat::Smooth { .. } => 1.0 - fresnel::dielectric(cos, self.eta).0,
            Coat::Rough { alpha, table, .. } => table.transmitted(cos, alpha),
        }
    }

    fn base_value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.base / (Vec3::ONE - self.returned()) * self.base_share(wo, wi)
    }

    /// The fraction of the light from the base that the coat reflects back and the base scatters again.
    fn returned(&self) -> Vec3 {
        let inside = match self.coat {
            Coat::Smooth { inside } => inside,
            Coat::Rough { alpha, table, .. } => table.reflected_inside(alpha),
        };
        if self.nonlinear { self.base * inside } else { Vec3::splat(inside) }
    }

    /// What a white base would scatter once, with the cosine.
    fn base_share(&self, wo: Vec3, wi: Vec3) -> f32 {
        let through = self.transmitted(wo.z) * self.transmitted(wi.z) / (self.eta * self.eta);
        through * FRAC_1_PI * wi.z
    }

    /// The base, and the coat if it is rough.
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let base = self.base_value(wo, wi);
        let (Coat::Rough { facets, .. }, Some(m)) = (self.coat, (wo + wi).try_normalize()) else { return base };
        let reflected = fresnel::dielectric(wo.dot(m).clamp(0.0, 1.0), self.eta).0;
        base + self.tint * (reflected * reflection(&facets, wo, wi, m))
    }

    /// The density of the directions that [`Self::eval`] covers.
    pub(crate) fn density(&self, wo: Vec3, wi: Vec3) -> f32 {
        let coat_share = 1.0 - self.transmitted(wo.z);
        let base = (1.0 - coat_share) * sampling::cosine_density(wi.z);
        match self.coat {
            Coat::Smooth { .. } => base,
            Coat::Rough { facets, .. } => base + coat_share * reflection_density(&facets, wo, wi),
        }
    }

    pub(crate) fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<LocalSample> {
        let coat_share = 1.0 - self.transmitted(wo.z);
        let wi = match self.coat {
            _ if u[0] >= coat_share => sampling::cosine_hemisphere([u[1], u[2]]),
            Coat::Smooth { .. } => {
                return Some(LocalSample::delta(Vec3::new(-wo.x, -wo.y, wo.z), self.tint, coat_share));
            }
            Coat::Rough { facets, .. } => reflect(wo, facets.sample(wo, [u[1], u[2]])),
        };
        let density = self.density(wo, wi);
        (wi.z > 0.0 && density > 0.0).then(|| LocalSample::spread(wi, self.eval(wo, wi), density))
    }
}
