//! The base colour with which the scored model reflects the same share of uniform light as a source material.
//!
//! The rule is measured once for each kind of material, and applied to colours and to textures, each of which is
//! derived once from a texture of the source.

use std::collections::BTreeMap;

use mateval_dataset::material::{ColorInput, Material, MaterialModel, ScalarInput, TextureIndex};
use mateval_dataset::reference::SourceTexture;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear, word_from_unit};
use mateval_image::{Texels, Texture};
use mateval_tracer::MaterialFault;
use mateval_tracer::bsdf::ReflectanceMeter;

/// How the base colour of a converted material follows from the colour of its source.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BaseColorRule {
    /// None where the source's colour is a base colour already.
    measured: Option<Measured>,
}

#[derive(Clone, Debug, PartialEq)]
struct Measured {
    source: [SourceLight; 3],
    /// The share of uniform light that the scored model reflects, for evenly spaced base colours from 0 to 1. It rises.
    converted: Vec<f64>,
}

/// The share of uniform light that a source material reflects in one channel, for a colour x:
/// `coat + (linear x + square x^2) / (1 - inside x)`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SourceLight {
    coat: f64,
    linear: f64,
    square: f64,
    inside: f64,
}

/// Base colours at which metals are measured, three at once, one a channel.
const METAL_STEPS: usize = 18;

impl BaseColorRule {
    /// The rule that keeps colours.
    pub(super) fn identity() -> Self {
        Self { measured: None }
    }

    /// Measures the models that `source` and `scored` make from a colour.
    pub(super) fn measure(
        meter: &mut ReflectanceMeter,
        source: impl Fn(ColorInput) -> MaterialModel,
        scored: impl Fn(ColorInput) -> MaterialModel,
        metallic: f32,
    ) -> Result<Self, MaterialFault> {
        let mut grey = |make: &dyn Fn(ColorInput) -> MaterialModel, value: f32| {
            meter.uniform(&make(ColorInput::Constant([value; 3])))
        };
        let found = [0.0, 0.5, 1.0].map(|value| grey(&source, value));
        let [black, half, white] = found;
        let (black, half, white) = (black?, half?, white?);
        let is_plastic = matches!(source(ColorInput::Constant([0.0; 3])), MaterialModel::Plastic { .. });
        let light = |c: usize| SourceLight::through(black[c], half[c] - black[c], white[c] - black[c], is_plastic);
        // The light of a base under facets is linear in its colour; that of metal is not.
        let last = if metallic > 0.0 { METAL_STEPS - 1 } else { 2 };
        let mut converted = Vec::with_capacity(last + 1);
        for step in (0..=last).step_by(3) {
            let values = [0, 1, 2].map(|next| (step + next) as f32 / last as f32);
            converted.extend(meter.uniform(&scored(ColorInput::Constant(values)))?);
        }
        Ok(Self { measured: Some(Measured { source: std::array::from_fn(light), converted }) })
    }

    /// The base colour of a linear colour of the source; both are clipped to 0..1.
    pub(super) fn apply(&self, color: [f32; 3]) -> [f32; 3] {
        let clipped = color.map(|value| value.clamp(0.0, 1.0));
        match &self.measured {
            None => clipped,
            Some(measured) => std::array::from_fn(|c| measured.channel(c, f64::from(clipped[c])) as f32),
        }
    }
}

impl Measured {
    fn channel(&self, channel: usize, color: f64) -> f64 {
        let source = &self.source[channel];
        let black = self.converted[0];
        let rise = rise_above(source.of_color(color), black - source.coat);
        self.base_color_for(black + rise)
    }

    /// The base colour with which the scored model reflects this share; the nearest of 0..1.
    fn base_color_for(&self, share: f64) -> f64 {
        let above = self.converted.partition_point(|found| *found < share).clamp(1, self.converted.len() - 1);
        let [lower, upper] = [self.converted[above - 1], self.converted[above]];
        let part = (share - lower) / (upper - lower);
        ((above as f64 - 1.0 + part) / (self.converted.len() - 1) as f64).clamp(0.0, 1.0)
    }
}

impl SourceLight {
    /// The curve through the light above black of a half and of a whole colour.
    fn through(coat: f64, half: f64, white: f64, is_plastic: bool) -> Self {
        if white <= 0.0 {
            return Self { coat, linear: 0.0, square: 0.0, inside: 0.0 };
        }
        if is_plastic {
            // Light that the coat sends back to the base: half / white = (1 - inside) / (2 - inside).
            let ratio = half / white;
            let inside = (1.0 - 2.0 * ratio) / (1.0 - ratio);
            return Self { coat, linear: white * (1.0 - inside), square: 0.0, inside };
        }
        // Oren and Nayar's second reflection is a square.
        let linear = 4.0 * half - white;
        Self { coat, linear, square: white - linear, inside: 0.0 }
    }

    /// The light of the colour alone, without the coat's.
    fn of_color(&self, x: f64) -> f64 {
        (self.linear * x + self.square * x * x) / (1.0 - self.inside * x)
    }
}

/// The light that the base has to add to that of the facets, so that both are `light`, where the facets alone reflect
/// `excess` more than the source's coat.
///
/// A surface of the scored model is never darker than its facets, which reflect 2 % at roughness 1. Below twice the
/// excess a parabola, which continues the line with its slope, keeps dark colours distinct; the result is brighter than
/// the source by at most the excess, at black.
fn rise_above(light: f64, excess: f64) -> f64 {
    if light >= 2.0 * excess { light - excess } else { light * light / (4.0 * excess) }
}

/// A change of a number.
type Change = fn(f32) -> f32;

/// The textures of a converted scene, in the order of their first use.
pub(super) struct DerivedTextures<'a> {
    source: &'a [SourceTexture],
    list: Vec<SourceTexture>,
    unchanged: Vec<(TextureIndex, TextureIndex)>,
    colors: Vec<(TextureIndex, BaseColorRule, Derived)>,
    scalars: Vec<(TextureIndex, usize, Change, TextureIndex)>,
}

#[derive(Clone, Copy)]
struct Derived {
    texture: TextureIndex,
    /// Whether a texel of the source exceeds 0..1.
    clipped: bool,
}

impl<'a> DerivedTextures<'a> {
    pub(super) fn new(source: &'a [SourceTexture]) -> Self {
        Self { source, list: Vec::new(), unchanged: Vec::new(), colors: Vec::new(), scalars: Vec::new() }
    }

    pub(super) fn into_list(self) -> Vec<SourceTexture> {
        self.list
    }

    /// The texture in the new list, as it is. An index out of range stays out of range.
    pub(super) fn unchanged(&mut self, texture: TextureIndex) -> TextureIndex {
        if let Some((_, known)) = self.unchanged.iter().find(|(source, _)| *source == texture) {
            return *known;
        }
        let Some(source) = self.source.get(texture.0) else { return TextureIndex(usize::MAX) };
        let added = self.add(source.clone());
        self.unchanged.push((texture, added));
        added
    }

    /// The material with its textures in the new list.
    pub(super) fn unchanged_material(&mut self, mut material: Material) -> Material {
        for texture in material.texture_indices_mut() {
            *texture = self.unchanged(*texture);
        }
        material
    }

    /// The base colour of a source's colour, and whether that exceeds 0..1.
    pub(super) fn color(&mut self, color: ColorInput, rule: &BaseColorRule) -> (ColorInput, bool) {
        match color {
            ColorInput::Constant(rgb) => (ColorInput::Constant(rule.apply(rgb)), exceeds_unit(rgb)),
            ColorInput::Texture { texture, uv } => {
                let Derived { texture, clipped } = self.color_texture(texture, rule);
                (ColorInput::Texture { texture, uv }, clipped)
            }
        }
    }

    fn color_texture(&mut self, texture: TextureIndex, rule: &BaseColorRule) -> Derived {
        let known = self.colors.iter().find(|(source, by, _)| *source == texture && by == rule);
        if let Some((.., known)) = known {
            return *known;
        }
        let Some(source) = self.source.get(texture.0) else {
            return Derived { texture: TextureIndex(usize::MAX), clipped: false };
        };
        let clipped = has_excess(&source.texture);
        let derived = if *rule == BaseColorRule::identity() && !clipped {
            Derived { texture: self.unchanged(texture), clipped }
        } else {
            let texels = color_texels(&source.texture, rule);
            Derived { texture: self.add(with_texels(source, texels)), clipped }
        };
        self.colors.push((texture, rule.clone(), derived));
        derived
    }

    /// A number in the new list, each texel changed by `change`; as it is without.
    pub(super) fn scalar(&mut self, number: ScalarInput, change: Option<Change>) -> ScalarInput {
        match (number, change) {
            (ScalarInput::Constant(value), Some(change)) => ScalarInput::Constant(change(value)),
            (ScalarInput::Constant(_), None) => number,
            (ScalarInput::Texture { texture, channel, uv }, None) => {
                ScalarInput::Texture { texture: self.unchanged(texture), channel, uv }
            }
            (ScalarInput::Texture { texture, channel, uv }, Some(change)) => {
                let texture = self.scalar_texture(texture, channel, change);
                ScalarInput::Texture { texture, channel: 0, uv }
            }
        }
    }

    fn scalar_texture(&mut self, texture: TextureIndex, channel: usize, change: Change) -> TextureIndex {
        let is_known = |(source, of, by, _): &&(TextureIndex, usize, Change, TextureIndex)| {
            *source == texture && *of == channel && std::ptr::fn_addr_eq(*by, change)
        };
        if let Some((.., known)) = self.scalars.iter().find(is_known) {
            return *known;
        }
        let Some(source) = self.source.get(texture.0).filter(|_| channel < 3) else { return TextureIndex(usize::MAX) };
        let values = source.texture.linear_texels().map(|texel| change(texel[channel]));
        let texels = match source.texture.texels() {
            Texels::Srgb16(_) | Texels::Linear(_) | Texels::Grey(_) => Texels::Grey(values.collect()),
            Texels::Srgb8(_) | Texels::Linear8(_) | Texels::Grey8(_) => {
                Texels::Grey8(values.map(byte_from_unit).collect())
            }
        };
        let added = self.add(with_texels(source, texels));
        self.scalars.push((texture, channel, change, added));
        added
    }

    /// The mean of a number over its texture, clipped to 0..1, and whether it has one.
    pub(super) fn mean_scalar(&self, number: ScalarInput) -> (f32, bool) {
        match number {
            ScalarInput::Constant(value) => (value, false),
            ScalarInput::Texture { texture, channel, .. } => {
                (self.mean(texture).map_or(f32::NAN, |mean| mean.get(channel).copied().unwrap_or(f32::NAN)), true)
            }
        }
    }

    /// The mean of a colour over its texture, clipped to 0..1, and whether it has one.
    pub(super) fn mean_color(&self, color: ColorInput) -> ([f32; 3], bool) {
        match color {
            ColorInput::Constant(rgb) => (rgb, false),
            ColorInput::Texture { texture, .. } => (self.mean(texture).unwrap_or([f32::NAN; 3]), true),
        }
    }

    fn mean(&self, texture: TextureIndex) -> Option<[f32; 3]> {
        let texture = &self.source.get(texture.0)?.texture;
        let mut sum = [0.0_f64; 3];
        for texel in texture.linear_texels() {
            sum.iter_mut().zip(texel).for_each(|(sum, value)| *sum += f64::from(value.clamp(0.0, 1.0)));
        }
        let count = (texture.width() * texture.height()) as f64;
        Some(sum.map(|sum| (sum / count) as f32))
    }

    fn add(&mut self, texture: SourceTexture) -> TextureIndex {
        self.list.push(texture);
        TextureIndex(self.list.len() - 1)
    }
}

/// The source's texture with other texels.
fn with_texels(source: &SourceTexture, texels: Texels) -> SourceTexture {
    let (width, height) = (source.texture.width(), source.texture.height());
    let texture = Texture::new(width, height, texels, source.texture.wrap());
    let texture = texture.expect("there is a texel for each of the source's");
    SourceTexture { name: source.name.clone(), sha256: source.sha256.clone(), texture }
}

/// The texels of a base colour, stored as finely as the source's.
fn color_texels(texture: &Texture, rule: &BaseColorRule) -> Texels {
    let values = texture.linear_texels();
    let encoded = |rgb: [f32; 3]| rule.apply(rgb).map(srgb_from_linear);
    match texture.texels() {
        Texels::Srgb8(_) | Texels::Linear8(_) | Texels::Grey8(_) => {
            // Bytes have few values: each is converted once.
            let mut known = BTreeMap::new();
            let mut byte = |channel: usize, value: f32| {
                let convert = || byte_from_unit(encoded([value; 3])[channel]);
                *known.entry((channel, value.to_bits())).or_insert_with(convert)
            };
            Texels::Srgb8(values.map(|rgb| std::array::from_fn(|c| byte(c, rgb[c]))).collect())
        }
        Texels::Srgb16(_) => Texels::Srgb16(values.map(|rgb| encoded(rgb).map(word_from_unit)).collect()),
        Texels::Linear(_) | Texels::Grey(_) => Texels::Linear(values.map(|rgb| rule.apply(rgb)).collect()),
    }
}

fn exceeds_unit(rgb: [f32; 3]) -> bool {
    !rgb.iter().all(|value| (-1e-6..=1.0 + 1e-6).contains(value))
}

/// Whether a texel exceeds 0..1, which only floats can.
fn has_excess(texture: &Texture) -> bool {
    match texture.texels() {
        Texels::Linear(v) => v.iter().any(|rgb| exceeds_unit(*rgb)),
        Texels::Grey(v) => v.iter().any(|grey| exceeds_unit([*grey; 3])),
        Texels::Srgb8(_) | Texels::Srgb16(_) | Texels::Linear8(_) | Texels::Grey8(_) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parabola_continues_the_line() {
        for excess in [-0.01, 0.0] {
            assert_eq!(rise_above(0.3, excess), 0.3 - excess);
        }
        let excess = 0.02;
        assert_eq!((rise_above(0.0, excess), rise_above(0.04, excess)), (0.0, 0.02));
        let slope = |at: f64| (rise_above(at + 1e-6, excess) - rise_above(at - 1e-6, excess)) / 2e-6;
        assert!((slope(0.04 - 2e-6) - 1.0).abs() < 1e-3 && (slope(0.04 + 2e-6) - 1.0).abs() < 1e-3);
        let steps: Vec<f64> = (0..100).map(|k| rise_above(k as f64 * 1e-3, excess)).collect();
        assert!(steps.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn a_curve_passes_through_its_points() {
        let plastic = SourceLight { coat: 0.09, linear: 0.4, square: 0.0, inside: 0.6 };
        let (half, white) = (plastic.of_color(0.5), plastic.of_color(1.0));
        let found = SourceLight::through(0.09, half, white, true);
        assert!((found.inside - 0.6).abs() < 1e-9 && (found.linear - 0.4).abs() < 1e-9, "{found:?}");
        let matt = SourceLight { coat: 0.0, linear: 0.8, square: 0.1, inside: 0.0 };
        let found = SourceLight::through(0.0, matt.of_color(0.5), matt.of_color(1.0), false);
        assert!((found.linear - 0.8).abs() < 1e-9 && (found.square - 0.1).abs() < 1e-9, "{found:?}");
    }
}
