//! Checks materials and precomputes the tables that some of them need.

use std::collections::BTreeMap;
use std::sync::Arc;

use mateval_image::Texture;
use mateval_scene::material::{
    ColorInput, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
};
use mateval_scene::reference::{MaterialIndex, ReferenceScene};

use super::fresnel::{self, eta_from_specular};
use super::principled_tables::BlenderTables;
use super::rough_boundary::{RoughCoat, Widths};
use crate::error::{MaterialFault, SceneFault};

/// One table per material.
#[derive(Debug)]
pub(crate) struct MaterialTables(Vec<Table>);

/// The precomputed values of one material.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    /// For Blender's principled.
    pub(crate) reflection: Option<Arc<BlenderTables>>,
    /// For rough plastic.
    pub(crate) coat: Option<Arc<RoughCoat>>,
    /// For smooth plastic: the fraction of uniform light from inside that its coat reflects back.
    pub(crate) inside: f32,
}

/// The tables computed so far, by the parameters that they depend on.
#[derive(Default)]
pub(super) struct Known {
    /// Keyed by the bits of eta.
    reflections: BTreeMap<u32, Arc<BlenderTables>>,
    /// Keyed by whether the distribution is GGX, the bits of eta, and the bits of alpha if that is constant.
    coats: BTreeMap<(bool, u32, Option<u32>), Arc<RoughCoat>>,
}

impl MaterialTables {
    /// Checks the materials' parameters and computes their tables. Materials with equal parameters share a table.
    pub(crate) fn new(scene: &ReferenceScene, textures: &[Texture]) -> Result<Self, SceneFault> {
        let mut known = Known::default();
        let mut tables = Vec::with_capacity(scene.materials.len());
        for (index, material) in scene.materials.iter().enumerate() {
            let located =
                |fault| SceneFault::Material { material: MaterialIndex(index), name: material.name.clone(), fault };
            check(material, textures.len()).map_err(located)?;
            tables.push(table(material, &mut known));
        }
        Ok(Self(tables))
    }

    pub(crate) fn of(&self, material: usize) -> &Table {
        &self.0[material]
    }
}

pub(super) fn table(material: &Material, known: &mut Known) -> Table {
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

/// Fails unless every constant is finite, every index of refraction above 0, and every texture and channel exist.
pub(super) fn check(material: &Material, textures: usize) -> Result<(), MaterialFault> {
    let inputs = material.model.inputs();
    for eta in inputs.etas {
        if !(eta.is_finite() && eta > 0.0) {
            return Err(MaterialFault::IndexOfRefraction(eta));
        }
    }
    inputs.colors.into_iter().try_for_each(|color| check_color(color, textures))?;
    inputs.scalars.into_iter().try_for_each(|scalar| check_scalar(scalar, textures))?;
    inputs.numbers.into_iter().try_for_each(check_number)?;
    material.opacity.iter().try_for_each(|opacity| check_scalar(opacity, textures))?;
    match &material.bump {
        Some(bump) => check_scalar(&bump.height, textures).and_then(|()| check_number(bump.scale)),
        None => Ok(()),
    }
}

fn check_color(input: &ColorInput, textures: usize) -> Result<(), MaterialFault> {
    match input {
        ColorInput::Constant(rgb) => rgb.iter().try_for_each(|&value| check_number(value)),
        ColorInput::Texture { texture, .. } => check_texture(texture.0, textures),
    }
}

fn check_scalar(input: &ScalarInput, textures: usize) -> Result<(), MaterialFault> {
    match *input {
        ScalarInput::Constant(value) => check_number(value),
        ScalarInput::Texture { texture, channel, .. } => {
            check_texture(texture.0, textures)?;
            if channel < 3 { Ok(()) } else { Err(MaterialFault::MissingChannel(channel)) }
        }
    }
}

fn check_texture(texture: usize, count: usize) -> Result<(), MaterialFault> {
    if texture < count { Ok(()) } else { Err(MaterialFault::MissingTexture { texture, count }) }
}

fn check_number(value: f32) -> Result<(), MaterialFault> {
    if value.is_finite() { Ok(()) } else { Err(MaterialFault::NotFinite(value)) }
}
