//! A material as it was read: what the surfaces of a primitive need to know of it.

use mateval_scene::material::StatedParameters;
use mateval_scene::reference::{EmissionMap, MaterialIndex};

/// A material that was read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReadMaterial {
    /// Its place in the scene.
    pub(super) index: MaterialIndex,
    /// The set of texture coordinates that its textures are looked up at; none where it has no texture.
    pub(super) uv_set: Option<u32>,
    /// What the file states of it.
    pub(super) stated: StatedParameters,
    /// Its emission, if it emits.
    pub(super) glow: Option<Glow>,
}

/// The emission of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Glow {
    /// Linear Rec. 709 radiance.
    pub(super) radiance: [f32; 3],
    /// The texture that multiplies it.
    pub(super) map: Option<EmissionMap>,
    /// Whether the back emits too.
    pub(super) two_sided: bool,
}
