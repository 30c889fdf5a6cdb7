//! A donor: another method's mesh of a scene's surfaces, with the materials that are transferred to the atlases.

use std::ops::Range;

use glam::{DVec3, Vec2, Vec3};
use mateval_image::Texture;

use super::error::{ImportError, Limited};
use super::limits::MAX_TRIANGLES;
use crate::estimate::{GivenMaps, Values};
use crate::median::DEFAULT;

/// Triangles in the dataset's world space, each with a material.
#[derive(Default)]
pub struct Donor {
    /// All triangles of the file.
    pub triangles: Vec<DonorTriangle>,
    /// The materials that triangles refer to by index.
    pub materials: Vec<DonorMaterial>,
    /// Number of vertices read so far.
    pub(super) vertices: usize,
    /// The named groups of triangles.
    pub groups: Vec<DonorGroup>,
}

/// A node of a glTF, or a group of an OBJ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DonorGroup {
    /// The group's own name, then those of its ancestors, nearest first.
    pub names: Vec<String>,
    /// Indices of its triangles in [`Donor::triangles`].
    pub triangles: Range<usize>,
}

/// A triangle of a donor.
#[derive(Clone, Debug, PartialEq)]
pub struct DonorTriangle {
    /// World space, in metres, +Y up.
    pub corners: [Vec3; 3],
    /// Texture coordinates of base_color, and those of roughness and metallic; v upwards.
    pub uvs: [[Vec2; 3]; 2],
    /// Linear factor of base_color at each corner.
    pub colors: [Vec3; 3],
    /// Index in [`Donor::materials`].
    pub material: usize,
}

/// Constants, multiplied by the textures where there are any. Roughness or metallic is `None` where the file gives
/// none.
#[derive(Clone)]
pub struct DonorMaterial {
    /// Linear factor and texture.
    pub base_color: ([f32; 3], Option<Texture>),
    /// Perceptual roughness.
    pub roughness: Option<Scalar>,
    /// Metallic, 0 to 1.
    pub metallic: Option<Scalar>,
}

/// A scalar of a material.
#[derive(Clone)]
pub struct Scalar {
    /// The constant factor.
    pub factor: f32,
    /// A linear texture, and the index of the channel that is used.
    pub texture: Option<(Texture, usize)>,
}

impl Donor {
    /// The corners of the triangle with this index, in the mesh's space.
    pub(super) fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].corners.map(|corner| corner.as_dvec3())
    }

    /// Appends a triangle.
    pub(super) fn push(&mut self, triangle: DonorTriangle) -> Result<(), ImportError> {
        if self.triangles.len() >= MAX_TRIANGLES {
            return Err(ImportError::TooLarge { what: Limited::Triangles, limit: MAX_TRIANGLES as u64 });
        }
        self.triangles.push(triangle);
        Ok(())
    }

    /// Which maps the materials of its triangles give.
    pub fn given_maps(&self) -> GivenMaps {
        let any = |has: fn(&DonorMaterial) -> bool| self.triangles.iter().any(|t| has(&self.materials[t.material]));
        GivenMaps {
            base_color: true,
            roughness: any(|m| m.roughness.is_some()),
            metallic: any(|m| m.metallic.is_some()),
        }
    }

    /// The side of a texel on the triangle, in metres, in the finest of the material's textures; infinite without
    /// textures.
    pub fn texel_size_m(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.corners(triangle);
        let triangle = &self.triangles[triangle];
        let material = &self.materials[triangle.material];
        let area = (b - a).cross(c - a).length();
        let scalars = [&material.roughness, &material.metallic].into_iter().flatten();
        let scalars = scalars.filter_map(|scalar| scalar.texture.as_ref().map(|(texture, _)| (1, texture)));
        let sizes = material.base_color.1.iter().map(|texture| (0, texture)).chain(scalars).map(|(set, texture)| {
            let [a, b, c] = triangle.uvs[set].map(|uv| uv.as_dvec2());
            let texels = (b - a).perp_dot(c - a).abs() * texture.width() as f64 * texture.height() as f64;
            (area / texels).sqrt()
        });
        sizes.filter(|size| *size > 0.0).fold(f64::INFINITY, f64::min)
    }

    /// The material at the place of a triangle with these barycentric weights.
    pub fn values(&self, triangle: usize, weights: DVec3) -> Values {
        let triangle = &self.triangles[triangle];
        let material = &self.materials[triangle.material];
        let weights = weights.as_vec3();
        let uv = |set: usize| {
            let [a, b, c] = triangle.uvs[set];
            (a * weights.x + b * weights.y + c * weights.z).to_array()
        };
        let scalar = |scalar: &Option<Scalar>, default: f32| match scalar {
            None => default,
            Some(Scalar { factor, texture: None }) => *factor,
            Some(Scalar { factor, texture: Some((texture, channel)) }) => factor * texture.sample(uv(1))[*channel],
        };
        let (factor, texture) = &material.base_color;
        let [a, b, c] = triangle.colors;
        let tint = Vec3::from(*factor) * (a * weights.x + b * weights.y + c * weights.z);
        let texel = texture.as_ref().map_or(Vec3::ONE, |texture| Vec3::from(texture.sample(uv(0))));
        let [r, g, b] = (tint * texel).to_array();
        [r, g, b, scalar(&material.roughness, DEFAULT[3]), scalar(&material.metallic, DEFAULT[4])]
    }
}
