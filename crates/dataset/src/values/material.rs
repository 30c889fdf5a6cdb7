//! Materials as parameters, as their sources state them, and the classes of material from which a source's reader draws
//! roughness and metallic. How materials scatter light is the tracer's `Bsdf`.

use std::fmt;

use glam::Vec2;
use mateval_image::Texture;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ids::PartId;

/// An index of [`crate::reference::ReferenceScene::textures`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct TextureIndex(pub usize);

/// A colour in linear Rec. 709, constant or from a texture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ColorInput {
    /// One colour everywhere.
    Constant([f32; 3]),
    /// A texture, looked up at the surface's uv.
    Texture {
        texture: TextureIndex,
        /// The mapping from the surface's uv to the texture's.
        uv: UvTransform,
    },
}

/// A number, constant or from a texture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ScalarInput {
    /// One number everywhere.
    Constant(f32),
    /// One channel of a texture, looked up at the surface's uv.
    Texture {
        texture: TextureIndex,
        /// 0 red, 1 green, 2 blue.
        channel: usize,
        /// The mapping from the surface's uv to the texture's.
        uv: UvTransform,
    },
}

/// A texture's uv from the surface's: `uv' = rows * (u, v, 1)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct UvTransform(pub [[f32; 3]; 2]);

impl Default for UvTransform {
    fn default() -> Self {
        Self([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    }
}

impl UvTransform {
    pub fn apply(&self, uv: Vec2) -> Vec2 {
        let row = |r: [f32; 3]| r[0] * uv.x + r[1] * uv.y + r[2];
        Vec2::new(row(self.0[0]), row(self.0[1]))
    }
}

impl ColorInput {
    /// The linear colour at the surface's `uv`.
    pub fn at(&self, textures: &[Texture], uv: Vec2) -> [f32; 3] {
        match self {
            Self::Constant(rgb) => *rgb,
            Self::Texture { texture, uv: transform } => textures[texture.0].sample(transform.apply(uv).to_array()),
        }
    }
}

impl ScalarInput {
    pub fn at(&self, textures: &[Texture], uv: Vec2) -> f32 {
        match self {
            Self::Constant(value) => *value,
            Self::Texture { texture, channel, uv: transform } => {
                textures[texture.0].sample(transform.apply(uv).to_array())[*channel]
            }
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// Trowbridge-Reitz.
    Ggx,
    /// Beckmann.
    Beckmann,
}

/// The microfacets of a rough interface. Perceptual roughness is the square root of `alpha`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Microfacets {
    /// The distribution of normals.
    pub distribution: Distribution,
    pub alpha: ScalarInput,
}

/// A conductor's index of refraction, as linear Rec. 709 values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ConductorIor {
    /// Reflects all light (Mitsuba's `material=none`).
    PerfectMirror,
    /// Complex index relative to the outside: eta + i k.
    EtaK {
        /// The real part.
        eta: [f32; 3],
        /// The imaginary part.
        k: [f32; 3],
    },
}

/// A model of scattering. The names are those of Mitsuba; `Principled` is Disney's model in one of two flavours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum MaterialModel {
    /// Lambert; with `alpha` Oren-Nayar.
    Diffuse {
        /// The share of light that is reflected.
        reflectance: ColorInput,
        /// Oren-Nayar's roughness, in Mitsuba's terms; none for Lambert.
        alpha: Option<ScalarInput>,
    },
    Conductor {
        ior: ConductorIor,
        /// Multiplies what is reflected.
        specular_reflectance: ColorInput,
        /// None: smooth.
        microfacets: Option<Microfacets>,
    },
    /// A diffuse base under a dielectric coat.
    Plastic {
        /// Inside over outside.
        eta: f32,
        /// Whether colour shifts from multiple internal reflections are included (Mitsuba's `nonlinear`).
        nonlinear: bool,
        /// The reflectance of the base.
        diffuse_reflectance: ColorInput,
        /// Multiplies what the coat reflects.
        specular_reflectance: ColorInput,
        /// None: smooth.
        microfacets: Option<Microfacets>,
    },
    /// A boundary between two clear media.
    Dielectric {
        /// Inside over outside.
        eta: f32,
        /// Multiplies what is reflected.
        specular_reflectance: ColorInput,
        /// Multiplies what is let through.
        specular_transmittance: ColorInput,
        /// None: smooth.
        microfacets: Option<Microfacets>,
    },
    /// A clear sheet with both its boundaries.
    ThinDielectric {
        /// Inside over outside.
        eta: f32,
        /// Multiplies what is reflected.
        specular_reflectance: ColorInput,
        /// Multiplies what is let through.
        specular_transmittance: ColorInput,
    },
    /// base_color, roughness and metallic.
    Principled {
        /// Linear.
        base_color: ColorInput,
        /// Perceptual, 0 to 1; alpha is its square.
        roughness: ScalarInput,
        /// 0 to 1.
        metallic: ScalarInput,
        /// Disney's parameter; 0.5 is an index of refraction of 1.5.
        specular: f32,
        /// Which renderer's version of the model.
        flavour: PrincipledFlavour,
    },
}

/// Which renderer's version of the principled model; on one room they differ by 12 %.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PrincipledFlavour {
    /// Blender 4.x.
    Blender,
    /// Mitsuba 3.
    Mitsuba,
}

/// A bump map: heights in metres from a texture, times `scale`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BumpMap {
    pub height: ScalarInput,
    /// The factor that multiplies the heights.
    pub scale: f32,
}

/// Where a surface's opacity is below this value, rays pass through it in the pictures without light (depth, ids,
/// materials).
pub const CUT_OUT_BELOW_OPACITY: f32 = 0.5;

/// Opacities that are neither none nor whole. What is seen through them is a mixture, which no single colour, depth or
/// id describes.
pub const FRACTIONAL_OPACITY: std::ops::RangeInclusive<f32> = 0.05..=0.95;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Its name in the source.
    pub name: String,
    pub model: MaterialModel,
    /// Whether the back looks like the front. Otherwise the back is black. Ignored for dielectrics.
    pub two_sided: bool,
    /// Opacity from 0, which lets all light pass straight through, to 1; none means opaque everywhere.
    pub opacity: Option<ScalarInput>,
    /// The bump map, which bends the shading normal.
    pub bump: Option<BumpMap>,
}

/// The values that a method should recover at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Linear.
    pub base_color: [f32; 3],
    /// Perceptual, 0 to 1.
    pub roughness: f32,
    /// 0 to 1.
    pub metallic: f32,
}

/// A parameter of a material that a method should recover, or emission.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaterialParameter {
    /// The base colour.
    BaseColor,
    /// The roughness.
    Roughness,
    /// The metallic.
    Metallic,
    /// The emission.
    Emission,
}

/// Which parameters of a surface's material its source states. The others are defaults of the source's format or of the
/// reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatedParameters {
    pub base_color: bool,
    pub roughness: bool,
    pub metallic: bool,
    pub emission: bool,
}

impl Default for StatedParameters {
    /// Everything is stated.
    fn default() -> Self {
        Self { base_color: true, roughness: true, metallic: true, emission: true }
    }
}

impl StatedParameters {
    /// The parameters that are not stated, sorted.
    pub fn unstated(self) -> Vec<MaterialParameter> {
        let all = [
            (self.base_color, MaterialParameter::BaseColor),
            (self.roughness, MaterialParameter::Roughness),
            (self.metallic, MaterialParameter::Metallic),
            (self.emission, MaterialParameter::Emission),
        ];
        all.into_iter().filter(|(is_stated, _)| !is_stated).map(|(_, parameter)| parameter).collect()
    }
}

/// A texture of a material and how it is looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lookup {
    pub texture: TextureIndex,
    /// 0 red, 1 green, 2 blue; 0 for colours.
    pub channel: usize,
    /// The mapping from the surface's uv to the texture's.
    pub uv: UvTransform,
}

/// The parameters of a [`MaterialModel`] by type, for checks and texture lookups that are the same for every model.
#[derive(Clone, Debug)]
pub struct ModelInputs {
    pub colors: Vec<ColorInput>,
    pub scalars: Vec<ScalarInput>,
    /// The real index of refraction, inside over outside.
    pub eta: Option<f32>,
    pub specular: Option<f32>,
}

impl Material {
    /// An opaque material without bumps, the same from both sides.
    pub fn new(name: impl Into<String>, model: MaterialModel) -> Self {
        Self { name: name.into(), model, two_sided: true, opacity: None, bump: None }
    }

    pub fn lookups(&self) -> Vec<Lookup> {
        let ModelInputs { colors, scalars, .. } = self.model.inputs();
        let around = self.opacity.into_iter().chain(self.bump.map(|bump| bump.height));
        let of_colors = colors.into_iter().filter_map(ColorInput::lookup);
        of_colors.chain(scalars.into_iter().chain(around).filter_map(ScalarInput::lookup)).collect()
    }

    /// The textures of all lookups, to be replaced.
    pub fn texture_indices_mut(&mut self) -> Vec<&mut TextureIndex> {
        let (colors, mut scalars) = self.model.inputs_mut();
        scalars.extend(self.opacity.iter_mut().chain(self.bump.iter_mut().map(|bump| &mut bump.height)));
        let of_colors = colors.into_iter().filter_map(|color| match color {
            ColorInput::Texture { texture, .. } => Some(texture),
            ColorInput::Constant(_) => None,
        });
        let of_scalars = scalars.into_iter().filter_map(|scalar| match scalar {
            ScalarInput::Texture { texture, .. } => Some(texture),
            ScalarInput::Constant(_) => None,
        });
        of_colors.chain(of_scalars).collect()
    }

    /// Whether the material has base_color, roughness and metallic. Glass does not.
    pub fn has_appearance(&self) -> bool {
        !matches!(self.model, MaterialModel::Dielectric { .. } | MaterialModel::ThinDielectric { .. })
    }

    /// base_color, roughness and metallic at the surface's `uv`; none for dielectrics.
    ///
    /// Principled materials, which every converted one is, have their own. In a scene with its source's materials,
    /// diffuse and plastic ones have their reflectance as base_color, and metallic 0; conductors have F0 times specular
    /// reflectance, and metallic 1. Roughness is the square root of alpha: 0 if smooth, 1 if diffuse.
    pub fn appearance(&self, textures: &[Texture], uv: Vec2) -> Option<Appearance> {
        let rough = |microfacets: &Option<Microfacets>| {
            microfacets.map_or(0.0, |m| m.alpha.at(textures, uv).clamp(0.0, 1.0).sqrt())
        };
        let appearance = match &self.model {
            MaterialModel::Diffuse { reflectance, .. } => {
                Appearance { base_color: reflectance.at(textures, uv), roughness: 1.0, metallic: 0.0 }
            }
            MaterialModel::Plastic { diffuse_reflectance, microfacets, .. } => Appearance {
                base_color: diffuse_reflectance.at(textures, uv),
                roughness: rough(microfacets),
                metallic: 0.0,
            },
            MaterialModel::Conductor { ior, specular_reflectance, microfacets } => {
                let tint = specular_reflectance.at(textures, uv);
                let f0 = ior.reflectance_at_normal();
                Appearance {
                    base_color: std::array::from_fn(|c| f0[c] * tint[c]),
                    roughness: rough(microfacets),
                    metallic: 1.0,
                }
            }
            MaterialModel::Principled { base_color, roughness, metallic, .. } => Appearance {
                base_color: base_color.at(textures, uv),
                roughness: roughness.at(textures, uv),
                metallic: metallic.at(textures, uv),
            },
            MaterialModel::Dielectric { .. } | MaterialModel::ThinDielectric { .. } => return None,
        };
        Some(appearance)
    }

    /// [`Self::appearance`] if it needs no texture; otherwise none.
    pub fn constant_appearance(&self) -> Option<Appearance> {
        let constant = |color: &ColorInput| color.lookup().is_none();
        let number = |scalar: &ScalarInput| scalar.lookup().is_none();
        let even = |microfacets: &Option<Microfacets>| microfacets.is_none_or(|m| number(&m.alpha));
        let same_everywhere = match &self.model {
            MaterialModel::Diffuse { reflectance, .. } => constant(reflectance),
            MaterialModel::Conductor { specular_reflectance, microfacets, .. } => {
                constant(specular_reflectance) && even(microfacets)
            }
            MaterialModel::Plastic { diffuse_reflectance, microfacets, .. } => {
                constant(diffuse_reflectance) && even(microfacets)
            }
            MaterialModel::Principled { base_color, roughness, metallic, .. } => {
                constant(base_color) && number(roughness) && number(metallic)
            }
            MaterialModel::Dielectric { .. } | MaterialModel::ThinDielectric { .. } => false,
        };
        if same_everywhere { self.appearance(&[], Vec2::ZERO) } else { None }
    }
}

impl ColorInput {
    fn lookup(self) -> Option<Lookup> {
        match self {
            Self::Constant(_) => None,
            Self::Texture { texture, uv } => Some(Lookup { texture, channel: 0, uv }),
        }
    }
}

impl ScalarInput {
    fn lookup(self) -> Option<Lookup> {
        match self {
            Self::Constant(_) => None,
            Self::Texture { texture, channel, uv } => Some(Lookup { texture, channel, uv }),
        }
    }
}

impl MaterialModel {
    /// Lambert's model of a grey surface.
    pub fn grey(reflectance: f32) -> Self {
        Self::Diffuse { reflectance: ColorInput::Constant([reflectance; 3]), alpha: None }
    }

    /// A boundary that light passes unchanged. It has no base colour, so it is not predicted.
    pub fn clear() -> Self {
        let white = ColorInput::Constant([1.0; 3]);
        Self::ThinDielectric { eta: 1.0, specular_reflectance: white, specular_transmittance: white }
    }

    /// All parameters of the model, by type.
    pub fn inputs(mut self) -> ModelInputs {
        let (eta, specular) = match self {
            Self::Plastic { eta, .. } | Self::Dielectric { eta, .. } | Self::ThinDielectric { eta, .. } => {
                (Some(eta), None)
            }
            Self::Principled { specular, .. } => (None, Some(specular)),
            Self::Diffuse { .. } | Self::Conductor { .. } => (None, None),
        };
        let (colors, scalars) = self.inputs_mut();
        let colors = colors.into_iter().map(|color| *color).collect();
        ModelInputs { colors, scalars: scalars.into_iter().map(|scalar| *scalar).collect(), eta, specular }
    }

    fn inputs_mut(&mut self) -> (Vec<&mut ColorInput>, Vec<&mut ScalarInput>) {
        match self {
            Self::Diffuse { reflectance, alpha } => (vec![reflectance], alpha.iter_mut().collect()),
            Self::Conductor { specular_reflectance, microfacets, .. } => {
                (vec![specular_reflectance], rough(microfacets))
            }
            Self::Plastic { diffuse_reflectance, specular_reflectance, microfacets, .. } => {
                (vec![diffuse_reflectance, specular_reflectance], rough(microfacets))
            }
            Self::Dielectric { specular_reflectance, specular_transmittance, microfacets, .. } => {
                (vec![specular_reflectance, specular_transmittance], rough(microfacets))
            }
            Self::ThinDielectric { specular_reflectance, specular_transmittance, .. } => {
                (vec![specular_reflectance, specular_transmittance], Vec::new())
            }
            Self::Principled { base_color, roughness, metallic, .. } => (vec![base_color], vec![roughness, metallic]),
        }
    }
}

fn rough(microfacets: &mut Option<Microfacets>) -> Vec<&mut ScalarInput> {
    microfacets.iter_mut().map(|microfacets| &mut microfacets.alpha).collect()
}

impl ConductorIor {
    /// F0 of each channel: ((eta-1)^2 + k^2) / ((eta+1)^2 + k^2).
    pub fn reflectance_at_normal(&self) -> [f32; 3] {
        match self {
            Self::PerfectMirror => [1.0; 3],
            Self::EtaK { eta, k } => std::array::from_fn(|c| {
                let k2 = k[c] * k[c];
                ((eta[c] - 1.0) * (eta[c] - 1.0) + k2) / ((eta[c] + 1.0) * (eta[c] + 1.0) + k2)
            }),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaterialClass {
    /// Clear or tinted glass, as the glossy surface of a dielectric.
    Glass,
    /// Bare metal.
    Metal,
    /// Polished stone.
    Stone,
    /// Glazed tiles and ceramics.
    Tile,
    /// Leather with a gloss.
    SmoothLeather,
    /// Other leather.
    Leather,
    /// Suede and velvet.
    Suede,
    /// Bamboo and rattan.
    Wicker,
    /// Coarse cloth, wool and carpets.
    CoarseCloth,
    /// Cotton and other cloth.
    Cloth,
    /// Wall paint, plaster and wallpaper.
    Paint,
    /// Painted or lacquered woodwork.
    Lacquer,
    /// Boards with faces of melamine.
    Board,
    /// Varnished or oiled wood.
    Wood,
    /// Plastic.
    Plastic,
}

impl MaterialClass {
    pub const ALL: [Self; 15] = [
        Self::Glass,
        Self::Metal,
        Self::Stone,
        Self::Tile,
        Self::SmoothLeather,
        Self::Leather,
        Self::Suede,
        Self::Wicker,
        Self::CoarseCloth,
        Self::Cloth,
        Self::Paint,
        Self::Lacquer,
        Self::Board,
        Self::Wood,
        Self::Plastic,
    ];
}

/// The word that JSON files use.
impl fmt::Display for MaterialClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// `ground_truth/material_classes.json`: the class of each of the source's own parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialClassesFile {
    /// Always `mateval/3`.
    pub format: String,
    /// In the order of `parts` of `scene.json`.
    pub parts: Vec<ClassifiedPart>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClassifiedPart {
    /// The part's id, as in `scene.json`.
    pub part: PartId,
    /// Its class; null where its triangles belong to several.
    pub class: Option<MaterialClass>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Copper's F0 from its published complex index (0.2004, 0.9240, 1.1022; 3.9129, 2.4528, 2.1421).
    #[test]
    fn copper_at_normal_incidence() {
        let copper = ConductorIor::EtaK { eta: [0.2004, 0.9240, 1.1022], k: [3.9129, 2.4528, 2.1421] };
        for (found, expected) in copper.reflectance_at_normal().into_iter().zip([0.9522, 0.6197, 0.5106]) {
            assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        }
        assert_eq!(ConductorIor::PerfectMirror.reflectance_at_normal(), [1.0; 3]);
    }

    #[test]
    fn a_class_prints_as_in_json() {
        assert_eq!(MaterialClass::SmoothLeather.to_string(), "smooth_leather");
    }
}
