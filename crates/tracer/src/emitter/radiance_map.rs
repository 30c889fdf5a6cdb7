//! How the radiance of a glowing surface differs from place to place.

use glam::{Vec2, Vec3};
use mateval_image::{Texels, Texture};
use mateval_scene::material::UvTransform;
use mateval_scene::reference::EmissionMap;

use crate::error::LightFault;

/// A factor of radiance, looked up at the surface's uv.
#[derive(Clone, Debug)]
pub(crate) struct RadianceMap {
    texture: Texture,
    uv: UvTransform,
}

impl RadianceMap {
    /// Fails where the texture is not there, or a number is not finite or a texel below 0.
    pub(crate) fn new(map: &EmissionMap, textures: &[Texture]) -> Result<Self, LightFault> {
        let index = map.texture.0;
        let missing = LightFault::MissingTexture { texture: index, count: textures.len() };
        let texture = textures.get(index).ok_or(missing)?;
        if !map.uv.0.as_flattened().iter().all(|v| v.is_finite()) {
            return Err(LightFault::MapTransform(map.uv.0));
        }
        if let Some(value) = first_unsound(texture) {
            return Err(LightFault::MapValue { texture: index, value });
        }
        Ok(Self { texture: texture.clone(), uv: map.uv })
    }

    /// Out of line: most lamps have none.
    #[inline(never)]
    pub(crate) fn at(&self, uv: Vec2) -> Vec3 {
        Vec3::from_array(self.texture.sample(self.uv.apply(uv).to_array()))
    }
}

/// The first value that is negative or not finite, so that it cannot be a share of light; integer texels never are.
fn first_unsound(texture: &Texture) -> Option<f32> {
    let unsound = |values: &[f32]| values.iter().copied().find(|v| !(v.is_finite() && *v >= 0.0));
    match texture.texels() {
        Texels::Linear(v) => unsound(v.as_flattened()),
        Texels::Grey(v) => unsound(v),
        Texels::Srgb8(_) | Texels::Srgb16(_) | Texels::Linear8(_) | Texels::Grey8(_) => None,
    }
}
