//! The innermost BSDF, which scatters light, with Mitsuba's defaults for absent parameters.

use mateval_scene::material::{ConductorIor, Distribution, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput};

use super::color::ColorUse;
use super::document::Element;
use super::parameters::Parameters;
use super::reader::Reader;
use super::{ior, value};
use mateval_scene::findings::shortened;

/// Mitsuba's lower bound of alpha.
const LEAST_ALPHA: f32 = 1e-4;

impl<'a> Reader<'a> {
    /// The model of `element`, which is not a wrapper.
    pub(super) fn model(&mut self, element: &'a Element, from: &mut Parameters<'a>) -> MaterialModel {
        match element.kind() {
            "diffuse" => MaterialModel::Diffuse { reflectance: self.color(from, "reflectance", 0.5), alpha: None },
            "roughdiffuse" => {
                from.ignore(&["use_fast_approx"]);
                let alpha = Some(self.scalar(from, "alpha", 0.2));
                MaterialModel::Diffuse { reflectance: self.color(from, "reflectance", 0.5), alpha }
            }
            kind @ ("conductor" | "roughconductor") => self.conductor(from, kind == "roughconductor"),
            kind @ ("plastic" | "roughplastic") => self.plastic(from, kind == "roughplastic"),
            kind @ ("dielectric" | "roughdielectric") => MaterialModel::Dielectric {
                eta: self.relative_index(from, "bk7"),
                specular_reflectance: self.color(from, "specular_reflectance", 1.0),
                specular_transmittance: self.color(from, "specular_transmittance", 1.0),
                microfacets: (kind == "roughdielectric").then(|| self.microfacets(from)),
            },
            "thindielectric" => MaterialModel::ThinDielectric {
                eta: self.relative_index(from, "bk7"),
                specular_reflectance: self.color(from, "specular_reflectance", 1.0),
                specular_transmittance: self.color(from, "specular_transmittance", 1.0),
            },
            "principled" => self.principled(from),
            _ => self.unknown_model(element, from),
        }
    }

    fn conductor(&mut self, from: &mut Parameters<'a>, rough: bool) -> MaterialModel {
        MaterialModel::Conductor {
            ior: self.conductor_ior(from),
            specular_reflectance: self.color(from, "specular_reflectance", 1.0),
            microfacets: rough.then(|| self.microfacets(from)),
        }
    }

    fn plastic(&mut self, from: &mut Parameters<'a>, rough: bool) -> MaterialModel {
        MaterialModel::Plastic {
            eta: self.relative_index(from, "polypropylene"),
            nonlinear: from.boolean("nonlinear", false, &mut self.log),
            diffuse_reflectance: self.color(from, "diffuse_reflectance", 0.5),
            specular_reflectance: self.color(from, "specular_reflectance", 1.0),
            microfacets: rough.then(|| self.microfacets(from)),
        }
    }

    /// The default is copper in Mitsuba 0.x and a perfect mirror in Mitsuba 3. `ext_eta` divides eta and k.
    fn conductor_ior(&mut self, from: &mut Parameters<'a>) -> ConductorIor {
        // Given numbers take precedence over the name of a material.
        let outside = self.index(from, "ext_eta").unwrap_or(1.0) as f32;
        let mut constant = |name: &str| {
            let element = from.take(&[name])?;
            let constant = self.constant(element, &from.place, ColorUse::Index);
            if constant.is_none() {
                from.mark_replaced(name);
            }
            constant
        };
        let (eta, k) = (constant("eta"), constant("k"));
        let material = from.string("material");
        let ior = match (eta, k) {
            (None, None) => self.named_conductor(from, material),
            (eta, k) => ConductorIor::EtaK { eta: eta.unwrap_or([0.0; 3]), k: k.unwrap_or([1.0; 3]) },
        };
        match ior {
            ConductorIor::EtaK { eta, k } => {
                ConductorIor::EtaK { eta: eta.map(|v| v / outside), k: k.map(|v| v / outside) }
            }
            mirror => mirror,
        }
    }

    fn named_conductor(&mut self, from: &mut Parameters<'a>, name: Option<&str>) -> ConductorIor {
        let name = name.unwrap_or(if self.major_version == 0 { "Cu" } else { "none" });
        ior::conductor(name).unwrap_or_else(|| {
            let message = format!("the conductor '{}' is not known", shortened(name));
            self.log.warn("unknown_material", &from.place, message, "used a perfect mirror");
            from.mark_replaced("material");
            ConductorIor::PerfectMirror
        })
    }

    /// The index of refraction inside divided by that outside.
    fn relative_index(&mut self, from: &mut Parameters<'a>, inside: &str) -> f32 {
        let named = |name| ior::dielectric(name).unwrap_or(1.0);
        let inside = self.index(from, "int_ior").unwrap_or_else(|| named(inside));
        let outside = self.index(from, "ext_ior").unwrap_or_else(|| named("air"));
        (inside / outside) as f32
    }

    /// Takes an index of refraction, given as a number or a name.
    fn index(&mut self, from: &mut Parameters<'a>, name: &str) -> Option<f64> {
        let index = |text: &str| ior::dielectric(text).map_or_else(|| value::number_within(text, 0.01, 100.0), Ok);
        from.value(name, index, &mut self.log)
    }

    fn microfacets(&mut self, from: &mut Parameters<'a>) -> Microfacets {
        from.ignore(&["sample_visible"]);
        let distribution = match from.string("distribution").unwrap_or("beckmann") {
            "ggx" => Distribution::Ggx,
            "beckmann" => Distribution::Beckmann,
            other => {
                let message = format!("the distribution '{}' is not supported", shortened(other));
                self.log.warn("unsupported", &from.place, message, "used beckmann");
                Distribution::Beckmann
            }
        };
        let alpha = match self.anisotropic_alpha(from) {
            Some(alpha) => ScalarInput::Constant(alpha),
            None => self.scalar(from, "alpha", 0.1),
        };
        let alpha = match alpha {
            ScalarInput::Constant(alpha) => ScalarInput::Constant(alpha.max(LEAST_ALPHA)),
            texture => texture,
        };
        Microfacets { distribution, alpha }
    }

    /// The geometric mean of `alpha_u` and `alpha_v`, where both are given.
    fn anisotropic_alpha(&mut self, from: &mut Parameters<'a>) -> Option<f32> {
        let mut along = |name| from.number_within(name, 0.0, 1.0, &mut self.log);
        let (u, v) = (along("alpha_u"), along("alpha_v"));
        let (u, v) = (u.or(v)?, v.or(u)?);
        if u != v {
            let message = format!("alpha_u {u} and alpha_v {v} differ");
            self.log.warn("unsupported", &from.place, message, "used their geometric mean");
        }
        Some((u * v).sqrt() as f32)
    }

    fn principled(&mut self, from: &mut Parameters<'a>) -> MaterialModel {
        let specular = match from.number_within("eta", 1.0, 100.0, &mut self.log) {
            // Disney's definition: F0 = 0.08 specular.
            Some(eta) => ((eta - 1.0) / (eta + 1.0)).powi(2) / 0.08,
            None => from.number_within("specular", 0.0, 1.0, &mut self.log).unwrap_or(0.5),
        };
        let extras = [
            "anisotropic",
            "spec_tint",
            "sheen",
            "sheen_tint",
            "flatness",
            "clearcoat",
            "clearcoat_gloss",
            "spec_trans",
        ];
        for name in extras {
            let value = self.scalar(from, name, 0.0);
            if value != ScalarInput::Constant(0.0) {
                let message = format!("'{name}' of principled is not supported");
                self.log.warn("unsupported", &from.place, message, "used 0");
            }
        }
        from.ignore(&["main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate"]);
        MaterialModel::Principled {
            base_color: self.color(from, "base_color", 0.5),
            roughness: self.scalar(from, "roughness", 0.5),
            metallic: self.scalar(from, "metallic", 0.0),
            specular: specular as f32,
            flavour: PrincipledFlavour::Mitsuba,
        }
    }
}
