//! Textures of converted materials, each derived once from a texture of the source.

use std::collections::BTreeMap;

use mateval_image::transfer::{byte_from_unit, srgb_from_linear, word_from_unit};
use mateval_image::{Texels, Texture};
use mateval_scene::material::{ColorInput, Material, ScalarInput, TextureIndex};
use mateval_scene::reference::SourceTexture;

use super::base_color::BaseColorRule;

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
        let values = texel_values(&source.texture).map(|texel| change(texel[channel]));
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
        for texel in texel_values(texture) {
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

/// The linear values of all texels, row by row.
fn texel_values(texture: &Texture) -> impl Iterator<Item = [f32; 3]> {
    let (width, height) = (texture.width(), texture.height());
    (0..height).flat_map(move |y| (0..width).map(move |x| texture.texel(x, y)))
}

/// The texels of a base colour, stored as finely as the source's.
fn color_texels(texture: &Texture, rule: &BaseColorRule) -> Texels {
    let values = texel_values(texture);
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
