//! A donor: another method's mesh of a scene's surfaces, with the materials that are transferred to the atlases; how
//! large it may be, and why its file was refused.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DVec3, Vec2, Vec3};
use mateval_dataset::gltf_file::GltfError;
use mateval_dataset::material::MaterialParameter;
use mateval_dataset::obj::Glow;
use mateval_files::source_folder::FileFault;
use mateval_files::untrusted::shortened;
use mateval_image::{ImageError, Texture};

use crate::estimate::{GivenMaps, Values};
use crate::maps::DEFAULT;

/// Largest number of triangles in a file.
pub(super) const MAX_TRIANGLES: usize = 5_000_000;
/// Largest number of texels in all textures of a file.
const MAX_TEXELS: usize = 1 << 28;
/// Largest size of a file, and of all buffers of a glTF together, in bytes.
pub(super) const MAX_FILE_BYTES: u64 = 1 << 31;

/// Why a file was refused. The caller adds the file's path.
#[derive(Debug, thiserror::Error)]
pub(super) enum ImportError {
    #[error("{0}")]
    Invalid(String),
    /// The file, or one that it names, is missing, unreadable, too large or outside the folder.
    #[error("{}", .0.message)]
    File(FileFault),
    #[error(transparent)]
    Gltf(#[from] GltfError),
    #[error(transparent)]
    Texture(#[from] ImageError),
}

impl From<FileFault> for ImportError {
    fn from(fault: FileFault) -> Self {
        Self::File(fault)
    }
}

/// Fails where a file has more of something than is read.
pub(super) fn check_most(found: usize, most: usize, what: &str) -> Result<(), ImportError> {
    if found > most { Err(ImportError::Invalid(format!("the file has more than {most} {what}"))) } else { Ok(()) }
}

/// Adds a texture to the texels of a file so far, and fails where they are too many.
pub(super) fn count_texels(texels: &mut usize, texture: &Texture) -> Result<(), ImportError> {
    *texels += texture.width() * texture.height();
    check_most(*texels, MAX_TEXELS, "texels in its textures")
}

/// Numbers this far outside 0 to 1 are rounding, and are clamped.
const ROUNDING: f32 = 0.001;

/// Whether the number lies within 0 to 1, but for rounding; NaN does not.
pub(super) fn is_unit(value: &f32) -> bool {
    (-ROUNDING..=1.0 + ROUNDING).contains(value)
}

/// The error about a colour that is out of range. `key` is such as `Kd`, or the JSON pointer of a glTF.
pub(super) fn out_of_range(key: &str, material: &str, found: &[f32]) -> ImportError {
    // Numbers that end little above 1 are not those of bytes.
    let are_bytes = found.iter().any(|v| *v > 2.0) && found.iter().all(|v| (0.0..=255.0).contains(v));
    let hint = if are_bytes { "; divide by 255" } else { "" };
    ImportError::Invalid(format!("{key} of '{}': expected 0 to 1, found {found:?}{hint}", shortened(material)))
}

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
    /// Number of triangles that have textures and no texture coordinates.
    pub without_uv: usize,
}

/// A node of a glTF, or a group of an OBJ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DonorGroup {
    /// The group's own name, then those of its ancestors, nearest first.
    pub names: Vec<String>,
    /// Indices of its triangles in [`Donor::triangles`].
    pub triangles: Range<usize>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct DonorTriangle {
    /// World space, in metres, +Y up.
    pub corners: [Vec3; 3],
    /// Texture coordinates of base_color, and those of roughness and metallic; v upwards.
    pub uvs: [[Vec2; 3]; 2],
    /// Linear factor of base_color at each corner.
    pub colors: [Vec3; 3],
    /// Whether the file states these colours, and not only white for all vertices.
    pub is_painted: bool,
    /// Index in [`Donor::materials`].
    pub material: usize,
}

/// Constants, multiplied by the textures where there are any. Roughness or metallic is `None` where the file states
/// none.
#[derive(Clone)]
pub struct DonorMaterial {
    /// Its name, for messages.
    pub name: String,
    /// Whether the file states the base colour. Otherwise it is the format's default.
    pub states_base_color: bool,
    /// Whether it shines by itself, where some tools put baked colours.
    pub glow: Glow,
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
    pub factor: f32,
    /// A linear texture, and the index of the channel that is used.
    pub texture: Option<(Texture, usize)>,
}

impl DonorMaterial {
    /// The material with the mean in place of the texture of base colour, and of those of roughness and metallic.
    fn flattened(&self, [base, numbers]: [bool; 2]) -> Self {
        let mut flat = self.clone();
        if base && let (factor, Some(texture)) = &self.base_color {
            let mean = texture.mean();
            flat.base_color = (std::array::from_fn(|channel| factor[channel] * mean[channel] as f32), None);
        }
        for scalar in [&mut flat.roughness, &mut flat.metallic].into_iter().flatten().filter(|_| numbers) {
            if let Some((texture, channel)) = scalar.texture.take() {
                scalar.factor *= texture.mean()[channel] as f32;
            }
        }
        flat
    }
}

/// The shift, for a mesh whose place is nearer to it than to the origin; otherwise the mesh is near the origin, as the
/// dataset's own files are.
pub(super) fn shift_near(place: DVec3, shift: DVec3) -> DVec3 {
    if place.distance(shift) < place.length() { shift } else { DVec3::ZERO }
}

impl Donor {
    /// Whether the file states the triangle's base colour, by its material or at its corners.
    fn states_base_color(&self, triangle: &DonorTriangle) -> bool {
        let material = &self.materials[triangle.material];
        // Black under emission, or white under an emissive texture, is how tools write a baked colour that viewers show
        // without light.
        let is_baked = match (material.glow, &material.base_color) {
            (Glow::None, _) => false,
            (_, ([0.0, 0.0, 0.0], _)) => true,
            (Glow::Textured, ([1.0, 1.0, 1.0], None)) => !triangle.is_painted,
            (Glow::Textured, (_, Some(texture))) => texture.mean() == [0.0; 3],
            _ => false,
        };
        (material.states_base_color || triangle.is_painted) && !is_baked
    }

    /// What the materials of its triangles do not state; sorted.
    pub fn unstated(&self) -> Vec<MaterialParameter> {
        let any = |lacks: fn(&DonorMaterial) -> bool| self.triangles.iter().any(|t| lacks(&self.materials[t.material]));
        let all = [
            (self.triangles.iter().any(|t| !self.states_base_color(t)), MaterialParameter::BaseColor),
            (any(|m| m.roughness.is_none()), MaterialParameter::Roughness),
            (any(|m| m.metallic.is_none()), MaterialParameter::Metallic),
        ];
        all.into_iter().filter(|(lacks, _)| *lacks).map(|(_, parameter)| parameter).collect()
    }

    /// Fails where the base colour of none of its triangles is stated: the whole donor would have the format's default.
    pub(super) fn check_base_color(&self) -> Result<(), ImportError> {
        if self.triangles.is_empty() || self.triangles.iter().any(|triangle| self.states_base_color(triangle)) {
            return Ok(());
        }
        let materials = || self.triangles.iter().map(|triangle| &self.materials[triangle.material]);
        let glowing = materials().find(|material| material.glow != Glow::None);
        let material = glowing.unwrap_or(&self.materials[self.triangles[0].material]);
        let advice = match material.glow {
            Glow::None => ": bake it to a texture, or state baseColorFactor or COLOR_0",
            _ => {
                ", which emits over black or white: baked colours belong into the base colour (baseColorTexture, map_Kd)"
            }
        };
        let name = shortened(&material.name);
        Err(ImportError::Invalid(format!("no material states a base colour, such as '{name}'{advice}")))
    }

    /// Gives the mean of its textures to every triangle without texture coordinates, which are NaN. Returns their
    /// number.
    pub(super) fn use_means(&mut self) -> usize {
        let (mut flat, mut count) = (BTreeMap::new(), 0);
        for at in 0..self.triangles.len() {
            let lacks = |set: usize| self.triangles[at].uvs[set].iter().any(|uv| !uv.is_finite());
            let lacking = [lacks(0), lacks(1)];
            let number = self.triangles[at].material;
            let material = &self.materials[number];
            let scalars = [&material.roughness, &material.metallic];
            let has_scalars = scalars.into_iter().flatten().any(|scalar| scalar.texture.is_some());
            let is_lost = [lacking[0] && material.base_color.1.is_some(), lacking[1] && has_scalars];
            if is_lost != [false; 2] {
                count += 1;
                self.triangles[at].material = *flat.entry((number, is_lost)).or_insert_with(|| {
                    let material = self.materials[number].flattened(is_lost);
                    self.materials.push(material);
                    self.materials.len() - 1
                });
            }
            for uv in self.triangles[at].uvs.iter_mut().flatten().filter(|uv| !uv.is_finite()) {
                *uv = Vec2::ZERO;
            }
        }
        self.without_uv += count;
        count
    }

    /// The corners of the triangle with this index, in the mesh's space.
    pub(super) fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].corners.map(|corner| corner.as_dvec3())
    }

    pub(super) fn push(&mut self, triangle: DonorTriangle) -> Result<(), ImportError> {
        self.triangles.push(triangle);
        check_most(self.triangles.len(), MAX_TRIANGLES, "triangles")
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle with one material.
    fn donor(base_color: [f32; 3], glow: Glow, is_painted: bool) -> Donor {
        let material = DonorMaterial {
            name: "m".to_owned(),
            states_base_color: true,
            glow,
            base_color: (base_color, None),
            roughness: None,
            metallic: None,
        };
        let (corners, uvs) = ([Vec3::ZERO, Vec3::X, Vec3::Y], [[Vec2::ZERO; 3]; 2]);
        let triangle = DonorTriangle { corners, uvs, colors: [Vec3::ONE; 3], is_painted, material: 0 };
        Donor { triangles: vec![triangle], materials: vec![material], ..Donor::default() }
    }

    #[test]
    fn only_numbers_of_bytes_are_to_be_divided() {
        let text = |found: &[f32]| out_of_range("Kd", "m", found).to_string();
        assert!(text(&[255.0, 128.0, 0.0]).ends_with("found [255.0, 128.0, 0.0]; divide by 255"));
        assert!(text(&[1.5, 1.0, 1.0]).ends_with("expected 0 to 1, found [1.5, 1.0, 1.0]"));
        assert!(text(&[-1.0, 3.0, 0.0]).ends_with("found [-1.0, 3.0, 0.0]"));
    }

    #[test]
    fn a_colour_that_lies_in_the_emission_is_refused() {
        for (constant, glow) in [(0.0, Glow::Textured), (1.0, Glow::Textured), (0.0, Glow::Plain)] {
            let refused = donor([constant; 3], glow, false).check_base_color().unwrap_err().to_string();
            assert!(refused.contains("emits over black or white"), "{constant}: {refused}");
        }
        // Twins: without emission, with another colour, and with colours of the vertices; a white lamp.
        for (constant, glow, is_painted) in [
            (1.0, Glow::None, false),
            (0.0, Glow::None, false),
            (0.5, Glow::Textured, false),
            (1.0, Glow::Textured, true),
            (1.0, Glow::Plain, false),
        ] {
            assert!(donor([constant; 3], glow, is_painted).check_base_color().is_ok(), "{constant}");
        }
        assert!(donor([1.0; 3], Glow::Textured, false).unstated().contains(&MaterialParameter::BaseColor));
        assert!(!donor([0.5; 3], Glow::Textured, false).unstated().contains(&MaterialParameter::BaseColor));
    }
}
