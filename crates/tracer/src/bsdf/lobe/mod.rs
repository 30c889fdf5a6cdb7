//! The scattering models behind one enum: parameters looked up at a point, in the frame of the shading normal.

mod conductor;
mod dielectric;
mod diffuse;
mod plastic;
mod principled;

use glam::{Vec2, Vec3};
use mateval_image::Texture;
use mateval_scene::material::{ColorInput, Material, MaterialModel, Microfacets};

use super::facets::Facets;
use super::fresnel::eta_from_specular;
use super::sample::LocalSample;
use super::tables::Table;
use crate::sampling;
use conductor::{Conductor, reflection_density};
use dielectric::Dielectric;
use plastic::{Coat, Plastic};
pub(crate) use principled::{Principled, PrincipledView, Response, Tint};

/// A material's parameters at one point. Opaque materials expect `wo.z > 0`, dielectrics accept either side.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Lobe<'w> {
    Black,
    Lambert { reflectance: Vec3 },
    OrenNayar { reflectance: Vec3, alpha: f32 },
    Mirror(Conductor),
    RoughConductor(Conductor, Facets),
    Plastic(Plastic<'w>),
    Dielectric(Dielectric),
    ThinDielectric(Dielectric),
    RoughDielectric(Dielectric, Facets),
    Principled(Principled<'w>),
}

impl<'w> Lobe<'w> {
    /// The material's parameters at `uv`. Long because it has one arm for each model.
    pub(crate) fn at(material: &Material, table: &'w Table, textures: &[Texture], uv: Vec2) -> Self {
        let color = |input: &ColorInput| Vec3::from_array(input.at(textures, uv));
        let facets = |m: &Microfacets| Facets::new(m.distribution, m.alpha.at(textures, uv));
        match &material.model {
            MaterialModel::Diffuse { reflectance, alpha: None } => Self::Lambert { reflectance: color(reflectance) },
            MaterialModel::Diffuse { reflectance, alpha: Some(alpha) } => {
                Self::OrenNayar { reflectance: color(reflectance), alpha: alpha.at(textures, uv) }
            }
            MaterialModel::Conductor { ior, specular_reflectance, microfacets } => {
                let conductor = Conductor { ior: *ior, tint: color(specular_reflectance) };
                match microfacets {
                    None => Self::Mirror(conductor),
                    Some(microfacets) => Self::RoughConductor(conductor, facets(microfacets)),
                }
            }
            MaterialModel::Plastic { eta, nonlinear, diffuse_reflectance, specular_reflectance, microfacets } => {
                let coat = match (microfacets, &table.coat) {
                    (Some(microfacets), Some(table)) => {
                        let alpha = microfacets.alpha.at(textures, uv);
                        Coat::Rough { facets: Facets::new(microfacets.distribution, alpha), alpha, table }
                    }
                    _ => Coat::Smooth { inside: table.inside },
                };
                let (base, tint) = (color(diffuse_reflectance), color(specular_reflectance));
                Self::Plastic(Plastic { eta: *eta, nonlinear: *nonlinear, base, tint, coat })
            }
            MaterialModel::Dielectric { eta, specular_reflectance, specular_transmittance, microfacets } => {
                let (reflectance, transmittance) = (color(specular_reflectance), color(specular_transmittance));
                let dielectric = Dielectric { eta: *eta, reflectance, transmittance };
                match microfacets {
                    None => Self::Dielectric(dielectric),
                    Some(microfacets) => Self::RoughDielectric(dielectric, facets(microfacets)),
                }
            }
            MaterialModel::ThinDielectric { eta, specular_reflectance, specular_transmittance } => {
                let (reflectance, transmittance) = (color(specular_reflectance), color(specular_transmittance));
                Self::ThinDielectric(Dielectric { eta: *eta, reflectance, transmittance })
            }
            MaterialModel::Principled { base_color, roughness, metallic, specular, flavour } => {
                Self::Principled(Principled {
                    base_color: color(base_color),
                    roughness: roughness.at(textures, uv).clamp(0.0, 1.0),
                    metallic: metallic.at(textures, uv).clamp(0.0, 1.0),
                    eta: eta_from_specular(*specular),
                    style: Principled::style(*flavour, table.reflection.as_deref()),
                })
            }
        }
    }

    /// Whether light passes to the other side.
    pub(crate) fn transmits(&self) -> bool {
        matches!(self, Self::Dielectric(_) | Self::ThinDielectric(_) | Self::RoughDielectric(..))
    }

    /// Whether all scattered directions are delta distributions, so that lights need not be sampled.
    pub(crate) fn is_delta(&self) -> bool {
        matches!(self, Self::Black | Self::Mirror(_) | Self::Dielectric(_) | Self::ThinDielectric(_))
    }

    /// The value times the cosine of `wi`. Delta lobes are left out.
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match self {
            Self::RoughDielectric(dielectric, facets) => dielectric.eval_rough(facets, wo, wi),
            _ if wo.z <= 0.0 || wi.z <= 0.0 => Vec3::ZERO,
            Self::Lambert { reflectance } => diffuse::lambert(*reflectance, wi),
            Self::OrenNayar { reflectance, alpha } => diffuse::oren_nayar(*reflectance, *alpha, wo, wi),
            Self::RoughConductor(conductor, facets) => conductor.eval(facets, wo, wi),
            Self::Plastic(plastic) => plastic.eval(wo, wi),
            Self::Principled(principled) => principled.eval(wo, wi),
            Self::Black | Self::Mirror(_) | Self::Dielectric(_) | Self::ThinDielectric(_) => Vec3::ZERO,
        }
    }

    /// The density with which [`Self::sample`] samples `wi`, per solid angle. Delta lobes are left out.
    pub(crate) fn density(&self, wo: Vec3, wi: Vec3) -> f32 {
        match self {
            Self::RoughDielectric(dielectric, facets) => dielectric.density_rough(facets, wo, wi),
            _ if wo.z <= 0.0 || wi.z <= 0.0 => 0.0,
            Self::Lambert { .. } | Self::OrenNayar { .. } => sampling::cosine_density(wi.z),
            Self::RoughConductor(_, facets) => reflection_density(facets, wo, wi),
            Self::Plastic(plastic) => plastic.density(wo, wi),
            Self::Principled(principled) => principled.density(wo, wi),
            Self::Black | Self::Mirror(_) | Self::Dielectric(_) | Self::ThinDielectric(_) => 0.0,
        }
    }

    /// Samples a direction for `wo`; `u[0]` selects the lobe. `None` if the sample is absorbed.
    pub(crate) fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<LocalSample> {
        if wo.z == 0.0 || (wo.z < 0.0 && !self.transmits()) {
            return None;
        }
        let pair = [u[1], u[2]];
        match self {
            Self::Black => None,
            Self::Lambert { .. } | Self::OrenNayar { .. } => diffuse::sample(pair, |wi| self.eval(wo, wi)),
            Self::Mirror(conductor) => Some(conductor.mirror(wo)),
            Self::RoughConductor(conductor, facets) => conductor.sample(facets, wo, pair),
            Self::Plastic(plastic) => plastic.sample(wo, u),
            Self::Dielectric(dielectric) => Some(dielectric.sample_smooth(wo, u[0])),
            Self::ThinDielectric(dielectric) => Some(dielectric.sample_thin(wo, u[0])),
            Self::RoughDielectric(dielectric, facets) => dielectric.sample_rough(facets, wo, u),
            Self::Principled(principled) => principled.sample(wo, u),
        }
    }
}
