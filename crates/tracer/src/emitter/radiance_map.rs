//! How the radiance of a glowing surface differs from place to place.

use glam::{Vec2, Vec3};
use mateval_image::{Texels, Texture};
use mateval_scene::material::UvTransform;
use mateval_scene::reference::EmissionMap;

/// A factor of radiance, looked up at the surface's uv.
#[derive(Clone, Debug)]
pub(crate) struct RadianceMap {
    texture: Texture,
    uv: UvTransform,
}

impl RadianceMap {
    /// Fails where the texture is not there, or a number is not finite or a texel below 0.
    pub(crate) fn new(map: &EmissionMap, textures: &[Texture]) -> Result<Self, String> {
        let index = map.texture.0;
        let texture = textures.get(index).ok_or(format!("texture {index} of {}", textures.len()))?;
        if !map.uv.0.as_flattened().iter().all(|v| v.is_finite()) {
            return Err("the uv of its map is not finite".into());
        }
        if !is_light(texture) {
            return Err(format!("texture {index} has texels that are negative or not finite; no light is that"));
        }
        Ok(Self { texture: texture.clone(), uv: map.uv })
    }

    /// Out of line: most lamps have none.
    #[inline(never)]
    pub(crate) fn at(&self, uv: Vec2) -> Vec3 {
        Vec3::from_array(self.texture.sample(self.uv.apply(uv).to_array()))
    }
}

/// Whether every texel can be a share of light; whole numbers always can.
fn is_light(texture: &Texture) -> bool {
    let sound = |values: &[f32]| values.iter().all(|v| v.is_finite() && *v >= 0.0);
    match texture.texels() {
        Texels::Linear(v) => sound(v.as_flattened()),
        Texels::Grey(v) => sound(v),
        Texels::Srgb8(_) | Texels::Srgb16(_) | Texels::Linear8(_) | Texels::Grey8(_) => true,
    }
}
