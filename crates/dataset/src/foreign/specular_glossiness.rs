//! Converts materials of the glTF extension `KHR_materials_pbrSpecularGlossiness` to base colour, roughness and
//! metallic.
//!
//! The formulas are those of the extension's own example, "convert-between-workflows" (Khronos, glTF repository, 2017).

use gltf::material::PbrSpecularGlossiness;
use mateval_image::{ImageError, Texels, Texture, Wrap};

/// The reflectance of a dielectric at normal incidence.
const DIELECTRIC: f32 = 0.04;
/// A divisor is at least this.
const LEAST: f32 = 1e-6;

/// A diffuse colour and a specular colour, linear, and a glossiness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularGlossiness {
    /// Linear diffuse colour.
    pub diffuse: [f32; 3],
    /// Linear reflectance at normal incidence.
    pub specular: [f32; 3],
    /// 1 minus the perceptual roughness.
    pub glossiness: f32,
}

/// The same as base colour, perceptual roughness and metallic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetallicRoughness {
    /// Linear base colour.
    pub base_color: [f32; 3],
    /// Perceptual roughness.
    pub roughness: f32,
    /// 0 to 1.
    pub metallic: f32,
}

impl SpecularGlossiness {
    /// The factors of a glTF's material. The extension's default of the specular colour is white, which leaves nothing
    /// of the diffuse colour; where the file states no specular colour, it is that of a dielectric.
    pub fn of(material: &PbrSpecularGlossiness<'_>, states_specular: bool) -> Self {
        let [red, green, blue, _] = material.diffuse_factor();
        let specular = if states_specular { material.specular_factor() } else { [DIELECTRIC; 3] };
        Self { diffuse: [red, green, blue], specular, glossiness: material.glossiness_factor() }
    }

    /// The material in the other parameters.
    pub fn converted(&self) -> MetallicRoughness {
        let Self { diffuse, specular, glossiness } = *self;
        let strength = specular.into_iter().fold(0.0, f32::max);
        let metallic = metallic(brightness(diffuse), brightness(specular), 1.0 - strength);
        let base_color = std::array::from_fn(|channel| {
            let of_diffuse = diffuse[channel] * (1.0 - strength) / (1.0 - DIELECTRIC) / (1.0 - metallic).max(LEAST);
            let of_specular = (specular[channel] - DIELECTRIC * (1.0 - metallic)) / metallic.max(LEAST);
            let share = metallic * metallic;
            (of_diffuse + (of_specular - of_diffuse) * share).clamp(0.0, 1.0)
        });
        MetallicRoughness { base_color, roughness: (1.0 - glossiness).clamp(0.0, 1.0), metallic }
    }
}

/// The perceived brightness of a colour (the extension's example).
fn brightness([red, green, blue]: [f32; 3]) -> f32 {
    (0.299 * red * red + 0.587 * green * green + 0.114 * blue * blue).sqrt()
}

/// The metallic that explains both brightnesses: a root of a quadratic equation.
fn metallic(diffuse: f32, specular: f32, rest: f32) -> f32 {
    if specular < DIELECTRIC {
        return 0.0;
    }
    let b = diffuse * rest / (1.0 - DIELECTRIC) + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let root = (b * b - 4.0 * DIELECTRIC * c).max(0.0).sqrt();
    ((root - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

/// Textures that multiply the factors of a material: of the diffuse colour, of the specular colour, and of the
/// glossiness.
#[derive(Clone, Copy, Debug, Default)]
pub struct SpecularTextures<'a> {
    /// Linear diffuse colour.
    pub diffuse: Option<&'a Texture>,
    /// Linear specular colour.
    pub specular: Option<&'a Texture>,
    /// Glossiness, of one number a texel.
    pub glossiness: Option<&'a Texture>,
}

/// The textures of a material as base colour (linear), and as roughness in green and metallic in blue, as glTF has
/// them. Both have as many texels as the largest of the given textures.
pub fn textures(factors: SpecularGlossiness, from: SpecularTextures<'_>) -> Result<[Texture; 2], ImageError> {
    let all = [from.diffuse, from.specular, from.glossiness];
    let size = |side: fn(&Texture) -> usize| all.into_iter().flatten().map(side).max().unwrap_or(1);
    let (width, height) = (size(Texture::width), size(Texture::height));
    let wrap = all.into_iter().flatten().next().map_or(Wrap::Repeat, Texture::wrap);
    let (mut base, mut numbers) = (Vec::with_capacity(width * height), Vec::with_capacity(width * height));
    for y in 0..height {
        for x in 0..width {
            // v points up.
            let uv = [(x as f32 + 0.5) / width as f32, 1.0 - (y as f32 + 0.5) / height as f32];
            let texel = |texture: Option<&Texture>| texture.map_or([1.0; 3], |texture| texture.sample(uv));
            let (diffuse, specular) = (texel(from.diffuse), texel(from.specular));
            let found = SpecularGlossiness {
                diffuse: std::array::from_fn(|c| factors.diffuse[c] * diffuse[c]),
                specular: std::array::from_fn(|c| factors.specular[c] * specular[c]),
                glossiness: factors.glossiness * texel(from.glossiness)[0],
            };
            let converted = found.converted();
            base.push(converted.base_color);
            numbers.push([0.0, converted.roughness, converted.metallic]);
        }
    }
    let texture = |texels| Texture::new(width, height, Texels::Linear(texels), wrap);
    Ok([texture(base)?, texture(numbers)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: [f32; 3], expected: [f32; 3]) -> bool {
        found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 2e-3)
    }

    /// Both workflows describe the same light: diffuse = base (1 - 0.04) (1 - metallic), specular = mix(0.04, base,
    /// metallic).
    #[test]
    fn the_conversion_is_undone() {
        for (base_color, metallic) in [([0.8, 0.2, 0.1], 0.0), ([0.9, 0.7, 0.3], 1.0), ([0.5; 3], 0.0)] {
            let specular: [f32; 3] =
                std::array::from_fn(|c: usize| DIELECTRIC + (base_color[c] - DIELECTRIC) * metallic);
            let strength = specular.into_iter().fold(0.0, f32::max);
            let diffuse = std::array::from_fn(|c: usize| {
                base_color[c] * (1.0 - DIELECTRIC) * (1.0 - metallic) / (1.0 - strength)
            });
            let found = SpecularGlossiness { diffuse, specular, glossiness: 0.7 }.converted();
            assert!(near(found.base_color, base_color), "{found:?}");
            assert!((found.metallic - metallic).abs() < 1e-3 && (found.roughness - 0.3).abs() < 1e-6);
        }
    }

    #[test]
    fn each_texel_is_converted() {
        let linear = |texels: Vec<[f32; 3]>| Texture::new(2, 1, Texels::Linear(texels), Wrap::Repeat).unwrap();
        let diffuse = linear(vec![[0.8, 0.2, 0.1], [0.0; 3]]);
        let specular = linear(vec![[0.04; 3], [0.9, 0.7, 0.3]]);
        let factors = SpecularGlossiness { diffuse: [1.0; 3], specular: [1.0; 3], glossiness: 0.25 };
        let from = SpecularTextures { diffuse: Some(&diffuse), specular: Some(&specular), glossiness: None };
        let [base, numbers] = textures(factors, from).unwrap();
        assert!(near(base.texel(0, 0), [0.8, 0.2, 0.1]) && near(base.texel(1, 0), [0.9, 0.7, 0.3]));
        assert!(near(numbers.texel(0, 0), [0.0, 0.75, 0.0]) && near(numbers.texel(1, 0), [0.0, 0.75, 1.0]));
    }
}
