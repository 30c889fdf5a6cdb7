//! A texture of a material and how it is looked up.

use mateval_image::Wrap;
use mateval_scene::material::UvTransform;

/// A texture of a material.
#[derive(Clone)]
pub(super) struct Lookup<'a> {
    pub(super) texture: gltf::Texture<'a>,
    /// The set of texture coordinates.
    pub(super) set: u32,
    /// The mapping from the surface's uv, with v upwards, to the texture's.
    pub(super) uv: UvTransform,
}

impl<'a> Lookup<'a> {
    /// The lookup of a material's texture, with its `KHR_texture_transform`.
    pub(super) fn new(info: &gltf::texture::Info<'a>) -> Self {
        let transform = info.texture_transform();
        let set = transform.as_ref().and_then(|transform| transform.tex_coord()).unwrap_or(info.tex_coord());
        Self { texture: info.texture(), set, uv: transform.map_or(UvTransform::default(), |t| upward(&t)) }
    }
}

/// The extension's matrix, translation * rotation * scale, for a v that grows upwards; glTF's grows downwards.
///
/// The rotation is counter-clockwise in the picture (KHR_texture_transform, section "Overview"). A transform that is
/// not finite maps everything to one point.
fn upward(transform: &gltf::texture::TextureTransform<'_>) -> UvTransform {
    let [offset_u, offset_v] = transform.offset().map(f64::from);
    let [scale_u, scale_v] = transform.scale().map(f64::from);
    let (sin, cos) = libm::sincos(f64::from(transform.rotation()));
    let downward = [[cos * scale_u, sin * scale_v, offset_u], [-sin * scale_u, cos * scale_v, offset_v]];
    let [[a, b, c], [d, e, f]] = downward;
    // v' = 1 - v on both sides.
    let rows = [[a, -b, b + c], [-d, e, 1.0 - e - f]];
    // Adding 0 turns the -0 of an absent rotation into 0.
    let rows = rows.map(|row| row.map(|value| value as f32 + 0.0));
    if rows.iter().flatten().all(|value| value.is_finite()) { UvTransform(rows) } else { UvTransform([[0.0; 3]; 2]) }
}

/// The modes in which a texture continues outside of 0..1; `(u, v)`.
pub(super) fn wraps(texture: &gltf::Texture<'_>) -> [Wrap; 2] {
    use gltf::texture::WrappingMode;
    let sampler = texture.sampler();
    [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    fn of(transform: &str) -> UvTransform {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"images":[{{"uri":"a"}}],"textures":[{{"source":0}}],"materials":[
            {{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0,"extensions":{{"KHR_texture_transform":{transform}}}}}}}}}]}}"#
        );
        let file = mateval_scene::gltf_file::parse(text.as_bytes()).unwrap().document;
        let info = file.materials().next().unwrap().pbr_metallic_roughness().base_color_texture().unwrap();
        Lookup::new(&info).uv
    }

    #[test]
    fn no_transform_is_the_identity() {
        assert_eq!(of("{}"), UvTransform::default());
    }

    /// The extension's example shader, by hand, at (0.25, 0.5) of glTF's coordinates.
    #[test]
    fn as_the_extension_defines_it() {
        let apply = |transform: &str| {
            let upward = of(transform).apply(Vec2::new(0.25, 1.0 - 0.5));
            Vec2::new(upward.x, 1.0 - upward.y)
        };
        assert_eq!(apply(r#"{"offset":[0.5,0.125],"scale":[2,3]}"#), Vec2::new(1.0, 1.625));
        // A quarter turn: matrix (0 1; -1 0) in glTF's coordinates.
        let turned = apply(r#"{"rotation":1.5707963267948966,"scale":[2,3]}"#);
        assert!((turned - Vec2::new(1.5, -0.5)).length() < 1e-6, "{turned}");
    }

    #[test]
    fn a_transform_that_overflows_is_one_point() {
        assert_eq!(of(r#"{"offset":[0,3e38],"scale":[1,3e38]}"#).apply(Vec2::ONE), Vec2::ZERO);
    }
}
