//! What materials need integrated beforehand.

use std::collections::BTreeMap;
use std::sync::Arc;

use mateval_image::Texture;
use mateval_scene::material::{
    ColorInput, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
};
use mateval_scene::reference::ReferenceScene;

use super::fresnel::{self, eta_from_specular};
use super::principled_tables::BlenderTables;
use super::rough_boundary::{RoughCoat, Widths};
use crate::error::TracerError;

/// One entry a material.
#[derive(Debug)]
pub(crate) struct MaterialTables(Vec<Table>);

/// What one material needs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    /// For Blender's principled.
    pub(crate) reflection: Option<Arc<BlenderTables>>,
    /// For rough plastic.
    pub(crate) coat: Option<Arc<RoughCoat>>,
    /// For smooth plastic: the share of uniform light from inside that its coat reflects back.
    pub(crate) inside: f32,
}

/// Tables made so far, by what they depend on.
#[derive(Default)]
struct Known {
    /// By the bits of eta.
    reflections: BTreeMap<u32, Arc<BlenderTables>>,
    /// By whether it is GGX, the bits of eta, those of alpha where it is the same everywhere.
    coats: BTreeMap<(bool, u32, Option<u32>), Arc<RoughCoat>>,
}

impl MaterialTables {
    /// Checks the materials' constants and integrates what they need, once for equal ones.
    pub(crate) fn new(scene: &ReferenceScene, textures: &[Texture]) -> Result<Self, TracerError> {
        let mut known = Known::default();
        let mut tables = Vec::with_capacity(scene.materials.len());
        for (index, material) in scene.materials.iter().enumerate() {
            check(material, textures.len())
                .map_err(|what| TracerError::Invalid(format!("material {index} '{}': {what}", material.name)))?;
            tables.push(table(material, &mut known));
        }
        Ok(Self(tables))
    }

    pub(crate) fn of(&self, material: usize) -> &Table {
        &self.0[material]
    }
}

fn table(material: &Material, known: &mut Known) -> Table {
    match &material.model {
        MaterialModel::Plastic { eta, microfacets: None, .. } => {
            Table { inside: fresnel::diffuse_reflectance(1.0 / eta), ..Table::default() }
        }
        MaterialModel::Plastic { eta, microfacets: Some(microfacets), .. } => {
            Table { coat: Some(known.coat(*eta, microfacets)), ..Table::default() }
        }
        MaterialModel::Principled { specular, flavour: PrincipledFlavour::Blender, .. } => {
            Table { reflection: Some(known.reflection(eta_from_specular(*specular))), ..Table::default() }
        }
        _ => Table::default(),
    }
}

impl Known {
    fn reflection(&mut self, eta: f32) -> Arc<BlenderTables> {
        let make = || Arc::new(BlenderTables::new(eta));
        self.reflections.entry(eta.to_bits()).or_insert_with(make).clone()
    }

    fn coat(&mut self, eta: f32, microfacets: &Microfacets) -> Arc<RoughCoat> {
        let alpha = match microfacets.alpha {
            ScalarInput::Constant(alpha) => Some(alpha),
            ScalarInput::Texture { .. } => None,
        };
        let distribution = microfacets.distribution;
        let make = || Arc::new(RoughCoat::new(distribution, eta, alpha.map_or_else(Widths::varying, Widths::uniform)));
        let key = (distribution == Distribution::Ggx, eta.to_bits(), alpha.map(f32::to_bits));
        self.coats.entry(key).or_insert_with(make).clone()
    }
}

/// Every constant finite, every index of refraction above 0, every texture there.
fn check(material: &Material, textures: usize) -> Result<(), String> {
    let mut inputs = Inputs { textures, fault: None };
    match &material.model {
        MaterialModel::Diffuse { reflectance, alpha } => {
            inputs.color(reflectance);
            alpha.iter().for_each(|alpha| inputs.scalar(alpha));
        }
        MaterialModel::Conductor { specular_reflectance, microfacets, .. } => {
            inputs.color(specular_reflectance);
            microfacets.iter().for_each(|m| inputs.scalar(&m.alpha));
        }
        MaterialModel::Plastic { eta, diffuse_reflectance, specular_reflectance, microfacets, .. } => {
            inputs.eta(*eta);
            inputs.color(diffuse_reflectance);
            inputs.color(specular_reflectance);
            microfacets.iter().for_each(|m| inputs.scalar(&m.alpha));
        }
        MaterialModel::Dielectric { eta, specular_reflectance, specular_transmittance, microfacets } => {
            inputs.eta(*eta);
            inputs.color(specular_reflectance);
            inputs.color(specular_transmittance);
            microfacets.iter().for_each(|m| inputs.scalar(&m.alpha));
        }
        MaterialModel::ThinDielectric { eta, specular_reflectance, specular_transmittance } => {
            inputs.eta(*eta);
            inputs.color(specular_reflectance);
            inputs.color(specular_transmittance);
        }
        MaterialModel::Principled { base_color, roughness, metallic, specular, .. } => {
            inputs.color(base_color);
            inputs.scalar(roughness);
            inputs.scalar(metallic);
            inputs.value(*specular);
        }
    }
    material.opacity.iter().for_each(|opacity| inputs.scalar(opacity));
    if let Some(bump) = &material.bump {
        inputs.scalar(&bump.height);
        inputs.value(bump.scale);
    }
    inputs.fault.map_or(Ok(()), Err)
}

/// Looks at a material's inputs and keeps the first fault.
struct Inputs {
    textures: usize,
    fault: Option<String>,
}

impl Inputs {
    fn demand(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds && self.fault.is_none() {
            self.fault = Some(what());
        }
    }

    fn value(&mut self, value: f32) {
        self.demand(value.is_finite(), || format!("value {value}, expected a finite one"));
    }

    fn eta(&mut self, eta: f32) {
        self.demand(eta.is_finite() && eta > 0.0, || format!("index of refraction {eta}, expected above 0"));
    }

    fn texture(&mut self, index: usize) {
        let count = self.textures;
        self.demand(index < count, || format!("texture {index} of {count}"));
    }

    fn color(&mut self, input: &ColorInput) {
        match input {
            ColorInput::Constant(rgb) => rgb.iter().for_each(|&v| self.value(v)),
            ColorInput::Texture { texture, .. } => self.texture(texture.0),
        }
    }

    fn scalar(&mut self, input: &ScalarInput) {
        match input {
            ScalarInput::Constant(value) => self.value(*value),
            ScalarInput::Texture { texture, channel, .. } => {
                self.texture(texture.0);
                self.demand(*channel < 3, || format!("texture channel {channel}, expected 0, 1 or 2"));
            }
        }
    }
}
