//! Bakes a material to the texels of an atlas: the mean of its appearance over each texel's square.

use glam::{DVec2, Vec2};
use mateval_dataset::TriangleMesh;
use mateval_dataset::material::{Appearance, Material};
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear, word_from_unit};
use mateval_image::{Picture, Texture};

use crate::atlas::Unwrapped;

/// The most lookups along a texel's side. A source with finer detail is undersampled.
const MAX_LOOKUPS: f64 = 16.0;

/// A material's three maps, as a submission holds them.
#[derive(Clone, Debug, PartialEq)]
pub enum BakedMaterial {
    /// Constant, in 16 bits, since the rounding of a single value does not average out.
    Constant {
        /// sRGB words.
        base_color: [u16; 3],
        /// Perceptual roughness, linear word.
        roughness: u16,
        /// Linear word.
        metallic: u16,
    },
    /// From a texture, in 8 bits like the source.
    Textured {
        /// sRGB bytes.
        base_color: Picture<[u8; 3]>,
        /// Perceptual roughness, linear bytes.
        roughness: Picture<u8>,
        /// Linear bytes.
        metallic: Picture<u8>,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct Baked {
    pub material: BakedMaterial,
    /// Whether a base colour exceeded 0..1 and was clipped.
    pub clipped: bool,
}

/// Bakes `material`, which is laid out by the uv of the source mesh, to the atlas. Each texel is the mean over its own
/// square; texels outside all triangles take the value of a neighbour. Returns none for dielectrics.
pub fn bake(unwrapped: &Unwrapped, source: &TriangleMesh, material: &Material, textures: &[Texture]) -> Option<Baked> {
    if !material.has_appearance() {
        return None;
    }
    if let Some(appearance) = material.constant_appearance() {
        return Some(bake_constant(&appearance));
    }
    let atlas = UvAtlas::new(&unwrapped.mesh, unwrapped.size as usize);
    let source_uv = |triangle: usize| {
        let uvs = source.uvs.as_deref()?;
        Some(source.triangles[triangle].map(|vertex| uvs[vertex as usize]))
    };
    let source_texels = texels_per_uv_unit(material, textures);
    let texel = |x: usize, y: usize| {
        let (triangle, _) = atlas.owner(x, y)?;
        let corners = source_uv(triangle).unwrap_or([Vec2::ZERO; 3]);
        let source_uv = |place: DVec2| {
            let weights = atlas.barycentrics(triangle, DVec2::new(x as f64, y as f64) + place).as_vec3();
            corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z
        };
        let lookups =
            [DVec2::X, DVec2::Y].map(|side| lookups_along(source_uv(side) - source_uv(DVec2::ZERO), source_texels));
        Some(mean_appearance(material, textures, lookups, source_uv))
    };
    Some(bake_texels(&atlas, texel))
}

fn bake_constant(appearance: &Appearance) -> Baked {
    let material = BakedMaterial::Constant {
        base_color: appearance.base_color.map(|v| word_from_unit(srgb_from_linear(v.clamp(0.0, 1.0)))),
        roughness: word_from_unit(appearance.roughness),
        metallic: word_from_unit(appearance.metallic),
    };
    Baked { material, clipped: leaves_unit(appearance) }
}

fn leaves_unit(appearance: &Appearance) -> bool {
    appearance.base_color.iter().any(|v| !(-1e-6..=1.0 + 1e-6).contains(v))
}

fn bake_texels(atlas: &UvAtlas, texel: impl Fn(usize, usize) -> Option<Appearance>) -> Baked {
    let size = atlas.size();
    let mut clipped = false;
    let mut base_color = Picture::filled(size, size, [0; 3]);
    let mut roughness = Picture::filled(size, size, 0);
    let mut metallic = Picture::filled(size, size, 0);
    for y in 0..size {
        for x in 0..size {
            let Some(seen) = texel(x, y) else { continue };
            clipped |= leaves_unit(&seen);
            let byte = |v: f32| byte_from_unit(srgb_from_linear(v.clamp(0.0, 1.0)));
            base_color.set(x, y, seen.base_color.map(byte));
            roughness.set(x, y, byte_from_unit(seen.roughness));
            metallic.set(x, y, byte_from_unit(seen.metallic));
        }
    }
    let (colors, rough, metals) = (base_color.pixels_mut(), roughness.pixels_mut(), metallic.pixels_mut());
    atlas.each_gutter_texel(|to, from| {
        colors[to] = colors[from];
        rough[to] = rough[from];
        metals[to] = metals[from];
    });
    Baked { material: BakedMaterial::Textured { base_color, roughness, metallic }, clipped }
}

/// The largest number of texels that any texture of the material has along one unit of the surface's u, and of its v.
fn texels_per_uv_unit(material: &Material, textures: &[Texture]) -> DVec2 {
    let lookups = material.lookups();
    let found = lookups.iter().filter_map(|lookup| textures.get(lookup.texture.0).map(|texture| (texture, lookup.uv)));
    found.fold(DVec2::ZERO, |most, (texture, uv)| {
        let size = DVec2::new(texture.width() as f64, texture.height() as f64);
        let [[a, b, _], [c, d, _]] = uv.0.map(|row| row.map(f64::from));
        most.max(DVec2::new((DVec2::new(a, c) * size).length(), (DVec2::new(b, d) * size).length()))
    })
}

/// The number of lookups along a texel's side, over which the source's uv changes by `step`, for which neighbouring
/// lookups are half a source texel apart or nearer.
fn lookups_along(step: Vec2, source_texels: DVec2) -> usize {
    let texels = step.as_dvec2().abs().dot(source_texels);
    // A sliver's steps may overflow.
    if texels.is_finite() { (2.0 * texels).ceil().clamp(1.0, MAX_LOOKUPS) as usize } else { 1 }
}

fn mean_appearance(
    material: &Material,
    textures: &[Texture],
    [columns, rows]: [usize; 2],
    source_uv: impl Fn(DVec2) -> Vec2,
) -> Appearance {
    let mut sum = [0.0_f64; 5];
    for row in 0..rows {
        for column in 0..columns {
            let place = DVec2::new((column as f64 + 0.5) / columns as f64, (row as f64 + 0.5) / rows as f64);
            // `bake` returns early for materials without an appearance.
            let Some(seen) = material.appearance(textures, source_uv(place)) else { continue };
            let [r, g, b] = seen.base_color;
            for (sum, value) in sum.iter_mut().zip([r, g, b, seen.roughness, seen.metallic]) {
                *sum += f64::from(value);
            }
        }
    }
    let [r, g, b, roughness, metallic] = sum.map(|sum| (sum / (columns * rows) as f64) as f32);
    Appearance { base_color: [r, g, b], roughness, metallic }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_dataset::material::{ColorInput, MaterialModel, TextureIndex, UvTransform};
    use mateval_image::{Texels, Wrap};
    use mateval_testkit::scenes::quad;

    use crate::atlas::{SizeWish, unwrap};

    use super::*;

    fn wall() -> TriangleMesh {
        quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y)
    }

    fn material(reflectance: ColorInput) -> Material {
        let model = MaterialModel::Diffuse { reflectance, alpha: None };
        Material { name: "m".to_owned(), model, two_sided: true, opacity: None, bump: None }
    }

    /// Red increases with u, green with v: the baked atlas must have the same values at the same points of the surface.
    #[test]
    fn a_ramp_is_the_same_through_the_atlas() {
        let ramp = (0..64 * 64).map(|at| [(at % 64) as f32 / 64.0, 1.0 - (at / 64) as f32 / 64.0, 0.5]).collect();
        let textures = [Texture::new(64, 64, Texels::Linear(ramp), Wrap::Clamp).unwrap()];
        let look = ColorInput::Texture { texture: TextureIndex(0), uv: UvTransform::default() };
        let unwrapped = unwrap(&wall(), SizeWish::Fixed(256)).unwrap();
        let baked = bake(&unwrapped, &wall(), &material(look), &textures).unwrap();
        let atlas = Texture::new(256, 256, Texels::Srgb8(base_color(baked).into_pixels()), Wrap::Clamp).unwrap();
        let uvs = unwrapped.mesh.uvs.as_ref().unwrap();
        for weights in [[0.2, 0.3, 0.5], [0.98, 0.01, 0.01], [0.0, 0.0, 1.0], [0.0, 0.5, 0.5]] {
            for triangle in 0..2 {
                let mix = |uvs: &[Vec2], t: [u32; 3]| (0..3).map(|k| uvs[t[k] as usize] * weights[k]).sum::<Vec2>();
                let found = atlas.sample(mix(uvs, unwrapped.mesh.triangles[triangle]).to_array());
                let source = mix(wall().uvs.as_ref().unwrap(), wall().triangles[triangle]);
                let expected = textures[0].sample(source.to_array());
                for channel in 0..3 {
                    assert!((found[channel] - expected[channel]).abs() < 0.01, "{weights:?} {found:?} {expected:?}");
                }
            }
        }
    }

    fn base_color(baked: Baked) -> Picture<[u8; 3]> {
        match baked.material {
            BakedMaterial::Textured { base_color, .. } => base_color,
            BakedMaterial::Constant { .. } => panic!("expected a textured material"),
        }
    }

    /// Every texel of the wall baked from a picture, far finer than the atlas, half of whose texels are white.
    fn assert_mean_grey(width: usize, height: usize, is_white: fn(usize, usize) -> bool) {
        let texels = (0..width * height).map(|at| f32::from(u8::from(is_white(at % width, at / width)))).collect();
        let textures = [Texture::new(width, height, Texels::Grey(texels), Wrap::Repeat).unwrap()];
        let look = ColorInput::Texture { texture: TextureIndex(0), uv: UvTransform::default() };
        let unwrapped = unwrap(&wall(), SizeWish::Fixed(64)).unwrap();
        let baked = bake(&unwrapped, &wall(), &material(look), &textures).unwrap();
        for texel in base_color(baked).pixels() {
            assert!(texel[0].abs_diff(188) <= 8, "{texel:?} is not the byte of linear 0.5");
        }
    }

    #[test]
    fn a_texel_is_the_mean_over_its_square() {
        assert_mean_grey(256, 256, |x, y| (x + y) % 2 == 1);
    }

    /// Stripes that are fine along u and absent along v. As many lookups along both sides as their mean asks for would
    /// miss them.
    #[test]
    fn stretched_textures_are_filtered_along_both_sides() {
        assert_mean_grey(512, 8, |x, _| x % 2 == 1);
    }

    #[test]
    fn constants_and_clipping() {
        let unwrapped = unwrap(&wall(), SizeWish::Fixed(64)).unwrap();
        let baked = bake(&unwrapped, &wall(), &material(ColorInput::Constant([0.5, 0.0, 1.5])), &[]).unwrap();
        // 48,192 of 65,535 is linear 0.5 on the sRGB curve.
        let material = BakedMaterial::Constant { base_color: [48_192, 0, 65_535], roughness: 65_535, metallic: 0 };
        assert_eq!(baked, Baked { material, clipped: true });
    }

    #[test]
    fn glass_is_not_baked() {
        let model = MaterialModel::ThinDielectric {
            eta: 1.5,
            specular_reflectance: ColorInput::Constant([1.0; 3]),
            specular_transmittance: ColorInput::Constant([1.0; 3]),
        };
        let glass = Material { model, ..material(ColorInput::Constant([0.0; 3])) };
        assert!(bake(&unwrap(&wall(), SizeWish::Fixed(64)).unwrap(), &wall(), &glass, &[]).is_none());
    }
}
