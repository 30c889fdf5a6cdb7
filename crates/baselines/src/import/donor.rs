//! Another mesh of a scene's surfaces, with what its maker says of them.

use std::ops::Range;

use glam::{DVec3, Vec2, Vec3};
use mateval_image::Texture;

use crate::estimate::{Says, Values};
use crate::median::DEFAULT;

/// Triangles in the dataset's world space, each with a material.
#[derive(Default)]
pub struct Donor {
    /// All of them.
    pub triangles: Vec<DonorTriangle>,
    /// What they name by number.
    pub materials: Vec<DonorMaterial>,
    /// Vertices that were read for them.
    pub(super) vertices: usize,
    /// Runs of triangles that the file gives names to.
    pub groups: Vec<DonorGroup>,
}

/// A node of a glTF, a group of an OBJ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DonorGroup {
    /// Its own name, then those of the nodes above.
    pub names: Vec<String>,
    /// Its triangles' numbers.
    pub triangles: Range<usize>,
}

/// Most triangles of a file.
pub const MAX_TRIANGLES: usize = 5_000_000;
/// Most vertices of a file, counted for each node that has them.
pub const MAX_VERTICES: usize = 3 * MAX_TRIANGLES;
/// Most texels of all textures of a file.
pub const MAX_TEXELS: usize = 1 << 28;
/// Most nodes of a glTF that hang below each other.
pub const MAX_DEPTH: usize = 64;
/// Largest file, and most of all buffers of a file, in bytes.
pub const MAX_FILE_BYTES: u64 = 1 << 31;

/// A triangle of a donor.
#[derive(Clone, Debug, PartialEq)]
pub struct DonorTriangle {
    /// Metres, +Y up.
    pub corners: [Vec3; 3],
    /// Where base_color and where roughness and metallic are looked up; v upwards.
    pub uvs: [[Vec2; 3]; 2],
    /// What base_color is multiplied with at each corner; linear.
    pub colors: [Vec3; 3],
    /// Its place in [`Donor::materials`].
    pub material: usize,
}

/// Constants, multiplied with textures where there are some. No roughness or metallic: nothing is said of it.
#[derive(Clone)]
pub struct DonorMaterial {
    /// Linear.
    pub base_color: ([f32; 3], Option<Texture>),
    /// Perceptual.
    pub roughness: Option<Scalar>,
    /// 0 to 1.
    pub metallic: Option<Scalar>,
}

/// A number of a material.
#[derive(Clone)]
pub struct Scalar {
    /// The constant.
    pub factor: f32,
    /// A linear texture, and the channel of it that counts.
    pub texture: Option<(Texture, usize)>,
}

impl Donor {
    /// Puts a triangle behind the others.
    pub(super) fn push(&mut self, triangle: DonorTriangle) -> Result<(), String> {
        if self.triangles.len() >= MAX_TRIANGLES {
            return Err(format!("more than {MAX_TRIANGLES} triangles"));
        }
        self.triangles.push(triangle);
        Ok(())
    }

    /// What the material of any of its triangles says.
    pub fn says(&self) -> Says {
        let any = |has: fn(&DonorMaterial) -> bool| self.triangles.iter().any(|t| has(&self.materials[t.material]));
        Says { base_color: true, roughness: any(|m| m.roughness.is_some()), metallic: any(|m| m.metallic.is_some()) }
    }

    /// How many metres a texel's side covers in a triangle, of the finest of its textures; infinite without any.
    pub fn texel_size_m(&self, triangle: usize) -> f64 {
        let triangle = &self.triangles[triangle];
        let material = &self.materials[triangle.material];
        let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3());
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

    /// What it says at a place of a triangle, given by barycentric weights.
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
