//! base_color, roughness, metallic: Disney's model in two flavours, front side only, alpha = roughness^2 with GGX.
//!
//! - Mitsuba: Burley, "Physically Based Shading at Disney" (2012) and "Extending the Disney BRDF to a BSDF" (2015), as
//!   Mitsuba 3 documents `principled`, with everything but base_color, roughness, metallic and specular at its default:
//!   an exact dielectric Fresnel term (weight 1 - metallic) and Schlick's with base_color (weight metallic) over one
//!   GGX lobe, and Disney's diffuse with retro-reflection (weight 1 - metallic), not reduced by what the lobe reflects.
//! - Blender: an approximation of Blender 4.x that is not certified against it yet. The same GGX lobe and Fresnel terms;
//!   Lambert's diffuse times (1 - metallic) times (1 - what the dielectric lobe reflects towards the viewer, from a
//!   table that we integrate). So it is not reciprocal, as Blender's is not. Not modelled: multiple scattering between
//!   facets, Blender's own fit of that table, its F82 tint (at its default, white, that is Schlick's).

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use mateval_scene::material::{Distribution, PrincipledFlavour};

use super::conductor::{reflection, reflection_density};
use super::facets::{Facets, reflect};
use super::fresnel;
use super::lobe::LocalSample;
use super::rough_boundary::RoughReflection;
use crate::warp;

/// The material at one place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Principled<'w> {
    pub(crate) base_color: Vec3,
    pub(crate) roughness: f32,
    pub(crate) metallic: f32,
    pub(crate) eta: f32,
    pub(crate) style: Style<'w>,
}

/// The flavour, with what it needs.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Style<'w> {
    Mitsuba,
    Blender(&'w RoughReflection),
}

/// Mitsuba's and Disney's; keeps the peak of a mirror finite.
const SMALLEST_ALPHA: f32 = 1e-3;

/// The index of refraction that Disney's `specular` stands for: F0 = 0.08 * specular.
pub(crate) fn eta_from_specular(specular: f32) -> f32 {
    2.0 / (1.0 - (0.08 * specular.clamp(0.0, 1.0)).sqrt()) - 1.0
}

impl<'w> Principled<'w> {
    pub(crate) fn style(flavour: PrincipledFlavour, table: Option<&'w RoughReflection>) -> Style<'w> {
        match (flavour, table) {
            (PrincipledFlavour::Blender, Some(table)) => Style::Blender(table),
            _ => Style::Mitsuba,
        }
    }

    fn alpha(&self) -> f32 {
        (self.roughness * self.roughness).max(SMALLEST_ALPHA)
    }

    fn facets(&self) -> Facets {
        Facets::new(Distribution::Ggx, self.alpha())
    }

    /// Which share of samples goes to the lobe: 1 against 1 - metallic for the diffuse part, whatever the colour.
    fn lobe_share(&self) -> f32 {
        1.0 / (2.0 - self.metallic)
    }

    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(m) = (wo + wi).try_normalize() else { return Vec3::ZERO };
        let cos = wo.dot(m).clamp(0.0, 1.0);
        self.fresnel(cos) * reflection(&self.facets(), wo, wi, m) + self.diffuse(wo, wi, cos)
    }

    fn fresnel(&self, cos: f32) -> Vec3 {
        let schlick = self.base_color + (Vec3::ONE - self.base_color) * fresnel::schlick_weight(cos);
        schlick * self.metallic + Vec3::splat((1.0 - self.metallic) * fresnel::dielectric(cos, self.eta).0)
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3, cos_difference: f32) -> Vec3 {
        let share = match self.style {
            Style::Mitsuba => self.disney_diffuse(wo.z, wi.z, cos_difference),
            Style::Blender(table) => 1.0 - table.reflected(wo.z, self.alpha()),
        };
        self.base_color * ((1.0 - self.metallic) * share * FRAC_1_PI * wi.z)
    }

    /// Burley 2015, equation 4, without subsurface.
    fn disney_diffuse(&self, cos_o: f32, cos_i: f32, cos_difference: f32) -> f32 {
        let (fo, fi) = (fresnel::schlick_weight(cos_o), fresnel::schlick_weight(cos_i));
        let retro = 2.0 * self.roughness * cos_difference * cos_difference;
        (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi) + retro * (fo + fi + fo * fi * (retro - 1.0))
    }

    pub(crate) fn density(&self, wo: Vec3, wi: Vec3) -> f32 {
        let share = self.lobe_share();
        share * reflection_density(&self.facets(), wo, wi) + (1.0 - share) * warp::cosine_density(wi.z)
    }

    pub(crate) fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<LocalSample> {
        let wi = if u[0] < self.lobe_share() {
            reflect(wo, self.facets().sample(wo, [u[1], u[2]]))
        } else {
            warp::cosine_hemisphere([u[1], u[2]])
        };
        let density = self.density(wo, wi);
        (wi.z > 0.0 && density > 0.0).then(|| LocalSample::spread(wi, self.eval(wo, wi), density))
    }
}
