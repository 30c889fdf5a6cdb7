//! Checks materials, precomputes the tables that some of them need, and measures the share of light that they reflect.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use mateval_dataset::material::{
    ColorInput, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
};
use mateval_dataset::reference::{MaterialIndex, ReferenceScene};
use mateval_image::Texture;

use super::blender_tables::BlenderTables;
use super::facets::{diffuse_reflectance, eta_from_specular};
use super::lobe::{Lobe, Table};
use super::rough_coat::{RoughCoat, Widths};
use crate::error::{ElementFault, MaterialFault};

#[derive(Debug)]
pub(crate) struct MaterialTables(Vec<Table>);

/// Measures materials, to compare the energy of two models. Tables that depend on the same parameters are computed
/// once.
#[derive(Default)]
pub struct ReflectanceMeter {
    known: Known,
}

/// The tables computed so far, by the parameters that they depend on.
#[derive(Default)]
struct Known {
    /// Keyed by the bits of eta.
    reflections: BTreeMap<u32, Arc<BlenderTables>>,
    /// Keyed by whether the distribution is GGX, the bits of eta, and the bits of alpha if that is constant.
    coats: BTreeMap<(bool, u32, Option<u32>), Arc<RoughCoat>>,
}

impl MaterialTables {
    /// Checks the materials' parameters and computes their tables. Materials with equal parameters share a table.
    pub(crate) fn new(scene: &ReferenceScene, textures: &[Texture]) -> Result<Self, ElementFault> {
        let mut known = Known::default();
        let mut tables = Vec::with_capacity(scene.materials.len());
        for (index, material) in scene.materials.iter().enumerate() {
            let located =
                |fault| ElementFault::Material { material: MaterialIndex(index), name: material.name.clone(), fault };
            check(material, textures.len()).map_err(located)?;
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
            Table { inside: diffuse_reflectance(1.0 / eta), ..Table::default() }
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
fn check(material: &Material, textures: usize) -> Result<(), MaterialFault> {
    let inputs = material.model.inputs();
    if let Some(eta) = inputs.eta.filter(|eta| !(eta.is_finite() && *eta > 0.0)) {
        return Err(MaterialFault::IndexOfRefraction(eta));
    }
    inputs.colors.iter().try_for_each(|color| check_color(color, textures))?;
    inputs.scalars.iter().try_for_each(|scalar| check_scalar(scalar, textures))?;
    inputs.specular.into_iter().try_for_each(check_number)?;
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

/// Directions of the viewer.
const VIEWERS: u32 = 64;
/// Samples for each direction of the viewer.
const SAMPLES: u32 = 1024;
/// Powers of the inverse of the root of x^4 = x + 1: the additive sequence of lowest discrepancy in three dimensions
/// (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018).
const STEPS: [f64; 3] = [0.819_172_513_396_164_5, 0.671_043_606_703_789_2, 0.549_700_477_901_970_5];

impl ReflectanceMeter {
    /// The share of light that a surface reflects, per channel, if the same radiance arrives from all directions above
    /// it. `model` has no textures. Dielectrics count what they transmit, too.
    ///
    /// Fails if a parameter is out of range or needs a texture.
    pub fn uniform(&mut self, model: &MaterialModel) -> Result<[f64; 3], MaterialFault> {
        let model = *model;
        let material = Material { name: String::new(), model, two_sided: true, opacity: None, bump: None };
        check(&material, 0)?;
        let table = table(&material, &mut self.known);
        let lobe = Lobe::at(&material, &table, &[], Vec2::ZERO);
        let mut sum = [0.0_f64; 3];
        for viewer in 0..VIEWERS {
            // Equal steps of the squared cosine have equal weights of the cosine.
            let cos2 = (f64::from(viewer) + 0.5) / f64::from(VIEWERS);
            let wo = Vec3::new((1.0 - cos2).sqrt() as f32, 0.0, cos2.sqrt() as f32);
            for sample in 0..SAMPLES {
                let number = f64::from(viewer * SAMPLES + sample);
                // A value just below 1 would become 1 as f32.
                let u = STEPS.map(|step| (((number + 0.5) * step).fract() as f32).min(1.0 - f32::EPSILON));
                if let Some(found) = lobe.sample(wo, u) {
                    sum.iter_mut().zip(found.weight.to_array()).for_each(|(sum, weight)| *sum += f64::from(weight));
                }
            }
        }
        Ok(sum.map(|sum| sum / f64::from(VIEWERS * SAMPLES)))
    }
}

#[cfg(test)]
mod tests {
    use mateval_dataset::material::{ConductorIor, TextureIndex};

    use super::*;

    fn conductor(ior: ConductorIor, alpha: f32) -> MaterialModel {
        let specular_reflectance = ColorInput::Constant([1.0; 3]);
        let alpha = ScalarInput::Constant(alpha);
        let microfacets = Some(Microfacets { distribution: Distribution::Ggx, alpha });
        MaterialModel::Conductor { ior, specular_reflectance, microfacets }
    }

    /// Matt surfaces reflect their reflectance. A smooth black plastic of index 1.5 reflects 0.0918 (Egan and Hilgeman
    /// 1973, table), and a conductor without absorption the same.
    #[test]
    fn known_shares() {
        let mut meter = ReflectanceMeter::default();
        let color = ColorInput::Constant([0.2, 0.5, 0.7]);
        let found = meter.uniform(&MaterialModel::Diffuse { reflectance: color, alpha: None }).unwrap();
        assert!(
            found.iter().zip([0.2, 0.5, 0.7]).all(|(found, expected)| (found - expected).abs() < 1e-5),
            "{found:?}"
        );
        let black = MaterialModel::Plastic {
            eta: 1.5,
            nonlinear: true,
            diffuse_reflectance: ColorInput::Constant([0.0; 3]),
            specular_reflectance: ColorInput::Constant([1.0; 3]),
            microfacets: None,
        };
        let glass = ConductorIor::EtaK { eta: [1.5; 3], k: [0.0; 3] };
        for model in [black, conductor(glass, 1e-3)] {
            let found = meter.uniform(&model).unwrap()[0];
            assert!((found - 0.0918).abs() < 1e-3, "{found}");
        }
    }

    /// Rough mirrors lose the light that hits a second facet: 1 - 0.971 at alpha 0.1 (GGX), 1 - 0.689 at 0.5, which
    /// Heitz et al., "Multiple-Scattering Microfacet BSDFs" (2016), show as the darkening of rough conductors.
    #[test]
    fn rough_mirrors_lose_light() {
        let mut meter = ReflectanceMeter::default();
        let shares = [0.02, 0.1, 0.25, 0.5]
            .map(|alpha| meter.uniform(&conductor(ConductorIor::PerfectMirror, alpha)).unwrap()[1]);
        assert!(shares[0] > 0.99 && shares[3] > 0.6 && shares.windows(2).all(|pair| pair[0] > pair[1]), "{shares:?}");
    }

    #[test]
    fn textures_and_parameters_out_of_range_are_refused() {
        let mut meter = ReflectanceMeter::default();
        let reflectance = ColorInput::Texture { texture: TextureIndex(0), uv: Default::default() };
        assert!(meter.uniform(&MaterialModel::Diffuse { reflectance, alpha: None }).is_err());
        let reflectance = ColorInput::Constant([f32::NAN; 3]);
        assert!(meter.uniform(&MaterialModel::Diffuse { reflectance, alpha: None }).is_err());
    }
}
