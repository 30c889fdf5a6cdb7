//! Metals, smooth and rough.

use glam::Vec3;
use mateval_scene::material::ConductorIor;

use crate::bsdf::facets::{Facets, reflect};
use crate::bsdf::fresnel;
use crate::bsdf::sample::LocalSample;

/// A metal: its index of refraction and a tint of the reflected light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conductor {
    pub(crate) ior: ConductorIor,
    pub(crate) tint: Vec3,
}

impl Conductor {
    /// The mirror direction as a delta sample.
    pub(crate) fn mirror(&self, wo: Vec3) -> LocalSample {
        let wi = Vec3::new(-wo.x, -wo.y, wo.z);
        LocalSample::delta(wi, self.tint * fresnel::conductor(wo.z, &self.ior), 1.0)
    }

    /// Walter et al. 2007, equation 20, with a conductor's Fresnel term.
    pub(crate) fn eval(&self, facets: &Facets, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(m) = (wo + wi).try_normalize() else { return Vec3::ZERO };
        let fresnel = fresnel::conductor(wo.dot(m).clamp(0.0, 1.0), &self.ior);
        self.tint * fresnel * reflection(facets, wo, wi, m)
    }

    pub(crate) fn sample(&self, facets: &Facets, wo: Vec3, u: [f32; 2]) -> Option<LocalSample> {
        let wi = reflect(wo, facets.sample(wo, u));
        let density = reflection_density(facets, wo, wi);
        (wi.z > 0.0 && density > 0.0).then(|| LocalSample::spread(wi, self.eval(facets, wo, wi), density))
    }
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
