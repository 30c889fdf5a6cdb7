//! The reference scene: surfaces with their materials and textures, and the lights. The ground truth is rendered
//! and baked from it.

use glam::Vec2;
use mateval_image::Texture;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::material::{Material, TextureIndex, UvTransform};
use crate::mesh::TriangleMesh;

/// An index of [`ReferenceScene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct MaterialIndex(pub usize);

/// An index of [`ReferenceScene::surfaces`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct SurfaceIndex(pub usize);

/// An index of [`ReferenceScene::lights`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct LightIndex(pub usize);

/// One source object: a mesh in world space and its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Its name in the source, not necessarily unique.
    pub name: String,
    /// Its triangles in world space.
    pub mesh: TriangleMesh,
    /// Its material.
    pub material: MaterialIndex,
}

/// A texture and the file that it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceTexture {
    /// The file, relative to the source's root, or the name of a computed texture, as in `sunsky`.
    pub name: String,
    /// SHA-256 of the file's bytes, hex; none for a computed one.
    pub sha256: Option<String>,
    /// The texels.
    pub texture: Texture,
}

/// A texture that varies the radiance of an emitting surface from place to place, as on a lamp's shade.
///
/// It is looked up at the surface's own uv, or at zero if the surface has none, and multiplies the radiance channel by
/// channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EmissionMap {
    /// The texture, which has no texel below 0.
    pub texture: TextureIndex,
    /// The mapping from the surface's uv to the texture's.
    pub uv: UvTransform,
}

impl EmissionMap {
    /// The linear factor of the radiance at the surface's `uv`.
    pub fn at(&self, textures: &[Texture], uv: Vec2) -> [f32; 3] {
        textures[self.texture.0].sample(self.uv.apply(uv).to_array())
    }
}

/// A kind of emitter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Emission {
    /// Surfaces that emit light.
    Area {
        /// The surfaces that emit.
        surfaces: Vec<SurfaceIndex>,
        /// Linear Rec. 709 radiance, W/(m^2 sr) in the scene's own unit.
        radiance: [f32; 3],
        /// A texture that multiplies the radiance from place to place; if absent, the radiance is the same everywhere.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        map: Option<EmissionMap>,
        /// Whether the back emits too, as in Blender but not in Mitsuba.
        two_sided: bool,
    },
    /// A latitude-longitude picture around the scene.
    Environment {
        /// Linear radiance. In the map's own frame a direction d is looked up at u = atan2(d.x, -d.z) / (2 pi),
        /// v (from the top) = acos(d.y) / pi (Mitsuba's convention).
        texture: TextureIndex,
        /// The factor that multiplies the texture.
        scale: f32,
        /// Rotation of the map's frame into the world, row-major.
        world_from_environment: [[f32; 3]; 3],
    },
    /// The same radiance from everywhere outside.
    Constant {
        /// Linear Rec. 709.
        radiance: [f32; 3],
    },
}

/// A group of emitters, which has its own picture in the light basis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightGroup {
    /// Its name, unique in the scene.
    pub name: String,
    /// How the group emits.
    pub emission: Emission,
    /// Whether camera rays see it emit. If not, they see the plain surface, or black for an environment.
    pub camera_visible: bool,
}

/// A scene with the materials of its truth and its lights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceScene {
    /// All surfaces, including glass and lamps.
    pub surfaces: Vec<Surface>,
    /// The materials of the surfaces.
    pub materials: Vec<Material>,
    /// The textures of materials and lights.
    pub textures: Vec<SourceTexture>,
    /// The groups of emitters.
    pub lights: Vec<LightGroup>,
}

impl ReferenceScene {
    /// The textures alone, for [`Material::appearance`]. Texels are shared, not copied.
    pub fn texture_list(&self) -> Vec<Texture> {
        self.textures.iter().map(|source| source.texture.clone()).collect()
    }
}
