//! A map of the radiance over an emitting surface.

use glam::{Vec2, Vec3};
use mateval_image::{Texels, Texture};
use mateval_scene::material::UvTransform;
use mateval_scene::reference::EmissionMap;

use crate::error::LightFault;

/// A factor on the radiance, looked up at the surface's uv.
#[derive(Clone, Debug)]
pub(crate) struct RadianceMap {
    texture: Texture,
    uv: UvTransform,
}

impl RadianceMap {
    /// Fails if the texture does not exist, if the uv transform is not finite, or if a texel is negative or not finite.
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

    /// Not inlined, since most lamps have no map.
    #[inline(never)]
    pub(crate) fn at(&self, uv: Vec2) -> Vec3 {
        Vec3::from_array(self.texture.sample(self.uv.apply(uv).to_array()))
    }
}

/// The first value that is negative or not finite and so cannot scale light. Integer texels are always valid.
fn first_unsound(texture: &Texture) -> Option<f32> {
    let unsound = |values: &[f32]| values.iter().copied().find(|v| !(v.is_finite() && *v >= 0.0));
    match texture.texels() {
        Texels::Linear(v) => unsound(v.as_flattened()),
        Texels::Grey(v) => unsound(v),
        Texels::Srgb8(_) | Texels::Srgb16(_) | Texels::Linear8(_) | Texels::Grey8(_) => None,
    }
}
