//! The reference scene: surfaces with their materials and textures, and the lights. The ground truth is rendered and
//! baked from it.
//!
//! On disk it is `ground_truth/reference/` and `ground_truth/lights.json`: `geometry.glb` holds a node for each surface
//! with its source uv, `textures/` holds decoded texels, so that no machine's picture decoder can change them, and
//! `reference.json` connects the two.

use std::collections::BTreeMap;
use std::path::Path;

use glam::Vec2;
use mateval_files::work_folder::make_folder;
use mateval_image::exr_io::{self, Precision};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Picture, Texels, Texture, Wrap, png_io};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::dataset::{FORMAT, SceneFile};
use crate::glb::{self, GlbNode};
use crate::layout::SceneFolder;
use crate::material::{Lookup, Material, MaterialModel, TextureIndex, UvTransform};
use crate::mesh::TriangleMesh;
use crate::{DatasetError, Finding, Severity, json};

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
    pub mesh: TriangleMesh,
    pub material: MaterialIndex,
}

/// A texture and the file that it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceTexture {
    /// The file, relative to the source's root, or the name of a computed texture, as in `sunsky`.
    pub name: String,
    /// SHA-256 of the file's bytes, hex; none for a computed one.
    pub sha256: Option<String>,
    pub texture: Texture,
}

impl SourceTexture {
    /// A texture that no file holds.
    pub fn computed(name: impl Into<String>, texture: Texture) -> Self {
        Self { name: name.into(), sha256: None, texture }
    }
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
    /// Surfaces that emit.
    Area {
        /// Indices of the surfaces that emit, in `reference.json`.
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
    pub materials: Vec<Material>,
    /// The textures of materials and lights.
    pub textures: Vec<SourceTexture>,
    pub lights: Vec<LightGroup>,
}

impl ReferenceScene {
    pub fn add_material(&mut self, material: Material) -> MaterialIndex {
        self.materials.push(material);
        MaterialIndex(self.materials.len() - 1)
    }

    pub fn add_texture(&mut self, texture: SourceTexture) -> TextureIndex {
        self.textures.push(texture);
        TextureIndex(self.textures.len() - 1)
    }

    /// The textures alone, for [`Material::appearance`]. Texels are shared, not copied.
    pub fn texture_list(&self) -> Vec<Texture> {
        self.textures.iter().map(|source| source.texture.clone()).collect()
    }
}

/// The materials as the source states them, in the order of [`ReferenceScene::materials`], with textures of their own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceMaterials {
    pub materials: Vec<Material>,
    /// The textures that they refer to.
    pub textures: Vec<SourceTexture>,
}

impl SourceMaterials {
    /// The materials of `scene` and the textures that they use. Indices of textures out of range stay out of range.
    pub fn of(scene: &ReferenceScene) -> Self {
        let mut new_from_old = BTreeMap::new();
        let mut found = Self { materials: scene.materials.clone(), textures: Vec::new() };
        for index in found.materials.iter_mut().flat_map(Material::texture_indices_mut) {
            let Some(texture) = scene.textures.get(index.0) else {
                *index = TextureIndex(usize::MAX);
                continue;
            };
            *index = *new_from_old.entry(*index).or_insert_with(|| {
                found.textures.push(texture.clone());
                TextureIndex(found.textures.len() - 1)
            });
        }
        found
    }

    /// `converted` with these materials in place of its own.
    pub fn in_scene(&self, converted: &ReferenceScene) -> ReferenceScene {
        let offset = converted.textures.len();
        let mut materials = self.materials.clone();
        for index in materials.iter_mut().flat_map(Material::texture_indices_mut) {
            index.0 = index.0.saturating_add(offset);
        }
        let textures = converted.textures.iter().chain(&self.textures).cloned().collect();
        ReferenceScene { materials, textures, ..converted.clone() }
    }
}

/// `reference.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceFile {
    /// Always `mateval/3`.
    pub format: String,
    /// In the order of the nodes of `geometry.glb`.
    pub surfaces: Vec<SurfaceEntry>,
    /// The materials of the surfaces.
    pub materials: Vec<Material>,
    /// The textures of materials and lights.
    pub textures: Vec<TextureEntry>,
}

/// `source/materials.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SourceMaterialsFile {
    /// Always `mateval/3`.
    pub format: String,
    /// In the order of `materials` of `reference.json`.
    pub materials: Vec<Material>,
    /// The textures of these materials, in `source/textures/`.
    pub textures: Vec<TextureEntry>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurfaceEntry {
    /// Its name in the source.
    pub name: String,
    /// Index of `materials`.
    pub material: MaterialIndex,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TextureEntry {
    /// The file in `textures/`.
    pub file: String,
    /// The file that it came from, relative to the source, or the name of a computed texture.
    pub source: String,
    /// SHA-256 of that file, hex; null for a computed one.
    pub source_sha256: Option<String>,
    pub texels: TexelKind,
    /// How it continues outside 0..1: `repeat`, `clamp` or `mirror`.
    pub wrap: Wrap,
}

/// How a texture's numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TexelKind {
    /// 8-bit PNG, sRGB.
    Srgb8,
    /// 16-bit PNG, sRGB.
    Srgb16,
    /// 8-bit PNG, linear.
    Linear8,
    /// 8-bit grey PNG, linear.
    Grey8,
    /// Float EXR `R`, `G`, `B`.
    Linear,
    /// Float EXR `V`.
    Grey,
}

/// `lights.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightsFile {
    /// Always `mateval/3`.
    pub format: String,
    /// The groups of emitters; their surfaces and textures are indices of the lists in `reference.json`.
    pub groups: Vec<LightGroup>,
}

/// Writes the scene below the scene's `ground_truth`.
pub fn write(folder: &SceneFolder, scene: &ReferenceScene) -> Result<(), DatasetError> {
    let reference = folder.reference();
    let textures = write_textures(&reference, &scene.textures)?;
    let nodes: Vec<GlbNode> = scene
        .surfaces
        .iter()
        .enumerate()
        .map(|(index, surface)| GlbNode { name: format!("surface_{index:05}"), mesh: surface.mesh.clone() })
        .collect();
    glb::write(&reference.join("geometry.glb"), &nodes)?;
    let surfaces = scene.surfaces.iter().map(|s| SurfaceEntry { name: s.name.clone(), material: s.material }).collect();
    let format = FORMAT.to_owned();
    let file = ReferenceFile { format: format.clone(), surfaces, materials: scene.materials.clone(), textures };
    json::write(&reference.join("reference.json"), &file)?;
    json::write(&folder.lights(), &LightsFile { format, groups: scene.lights.clone() })
}

/// Writes the source's own materials below the reference scene.
pub fn write_source_materials(folder: &SceneFolder, source: &SourceMaterials) -> Result<(), DatasetError> {
    let place = folder.source_materials();
    let textures = write_textures(&place, &source.textures)?;
    let file = SourceMaterialsFile { format: FORMAT.to_owned(), materials: source.materials.clone(), textures };
    json::write(&place.join(SOURCE_MATERIALS), &file)
}

/// Reads the files of [`write_source_materials`]; absent if the scene has none. Every index out of range is a finding
/// of the error; `count` is the number of the scene's materials.
pub fn read_source_materials(folder: &SceneFolder, count: usize) -> Result<Option<SourceMaterials>, DatasetError> {
    let place = folder.source_materials();
    let path = place.join(SOURCE_MATERIALS);
    if !path.exists() {
        return Ok(None);
    }
    let file: SourceMaterialsFile = json::read_format(&path, FORMAT)?;
    let mut faults = Faults(Vec::new());
    if file.materials.len() != count {
        faults.add(SOURCE_MATERIALS, "/materials", format!("{} materials, expected {count}", file.materials.len()));
    }
    faults.check_materials(SOURCE_MATERIALS, &file.materials, &file.textures);
    if !faults.0.is_empty() {
        return Err(DatasetError::Invalid { path, findings: faults.0 });
    }
    let textures = read_textures(&place, &file.textures)?;
    Ok(Some(SourceMaterials { materials: file.materials, textures }))
}

/// The name of the file of the source's own materials.
pub const SOURCE_MATERIALS: &str = "materials.json";

/// Reads the files of [`write()`]. Every index out of range is a finding of the error.
pub fn read(folder: &SceneFolder) -> Result<ReferenceScene, DatasetError> {
    let reference = folder.reference();
    let path = reference.join("reference.json");
    let file: ReferenceFile = json::read_format(&path, FORMAT)?;
    let lights: LightsFile = json::read_format(&folder.lights(), FORMAT)?;
    let nodes = glb::read(&reference.join("geometry.glb"))?;
    let faults = dangling(&file, &lights, nodes.len());
    if !faults.is_empty() {
        return Err(DatasetError::Invalid { path, findings: faults });
    }
    let textures = read_textures(&reference, &file.textures)?;
    let surfaces = file
        .surfaces
        .into_iter()
        .zip(nodes)
        .map(|(entry, node)| Surface { name: entry.name, mesh: node.mesh, material: entry.material })
        .collect();
    Ok(ReferenceScene { surfaces, materials: file.materials, textures, lights: lights.groups })
}

/// Writes textures to the folder `textures` in `place`, which is made.
fn write_textures(place: &Path, textures: &[SourceTexture]) -> Result<Vec<TextureEntry>, DatasetError> {
    let folder = place.join("textures");
    make_folder(&folder)?;
    textures.iter().enumerate().map(|(index, source)| write_texture(&folder, index, source)).collect()
}

fn read_textures(place: &Path, entries: &[TextureEntry]) -> Result<Vec<SourceTexture>, DatasetError> {
    entries.iter().map(|entry| read_texture_entry(place, entry)).collect()
}

fn write_texture(folder: &Path, index: usize, source: &SourceTexture) -> Result<TextureEntry, DatasetError> {
    let texture = &source.texture;
    let (width, height) = (texture.width(), texture.height());
    let stem = folder.join(format!("{index:04}"));
    let (png, exr) = (stem.with_extension("png"), stem.with_extension("exr"));
    let (file, texels) = match texture.texels() {
        Texels::Srgb8(v) => {
            png_io::write_rgb_bytes(&png, &Picture::new(width, height, v.clone())?)?;
            (png, TexelKind::Srgb8)
        }
        Texels::Srgb16(v) => {
            png_io::write_rgb_words(&png, &Picture::new(width, height, v.clone())?)?;
            (png, TexelKind::Srgb16)
        }
        Texels::Linear8(v) => {
            png_io::write_rgb_bytes(&png, &Picture::new(width, height, v.clone())?)?;
            (png, TexelKind::Linear8)
        }
        Texels::Grey8(v) => {
            png_io::write_grey_bytes(&png, &Picture::new(width, height, v.clone())?)?;
            (png, TexelKind::Grey8)
        }
        Texels::Linear(v) => {
            let picture = Picture::new(width, height, v.iter().map(|rgb| LinearRgb(*rgb)).collect())?;
            exr_io::write_linear(&exr, &picture, Precision::Float)?;
            (exr, TexelKind::Linear)
        }
        Texels::Grey(v) => {
            exr_io::write_scalar(&exr, &Picture::new(width, height, v.clone())?, Precision::Float)?;
            (exr, TexelKind::Grey)
        }
    };
    let wrap = texture.wrap();
    let file = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(TextureEntry { file, source: source.name.clone(), source_sha256: source.sha256.clone(), texels, wrap })
}

fn read_texture_entry(reference: &Path, entry: &TextureEntry) -> Result<SourceTexture, DatasetError> {
    let path = reference.join("textures").join(&entry.file);
    let wrap = entry.wrap;
    let texture = match entry.texels {
        TexelKind::Srgb8 | TexelKind::Srgb16 => read_texture(&path, Encoding::Srgb, wrap)?,
        TexelKind::Linear8 | TexelKind::Grey8 | TexelKind::Linear => read_texture(&path, Encoding::Linear, wrap)?,
        TexelKind::Grey => {
            let picture = exr_io::read_scalar(&path)?;
            Texture::new(picture.width(), picture.height(), Texels::Grey(picture.into_pixels()), wrap)?
        }
    };
    Ok(SourceTexture { name: entry.source.clone(), sha256: entry.source_sha256.clone(), texture })
}

/// References that lead nowhere.
struct Faults(Vec<Finding>);

impl Faults {
    fn add(&mut self, file: &str, place: impl Into<String>, message: String) {
        let action = "fetch or build the dataset again";
        self.0.push(Finding::new(Severity::Error, "dangling_reference", file, place, message, action));
    }

    /// Adds every texture's file name that leads out of `textures/`, and every index of a texture out of range.
    fn check_materials(&mut self, file: &str, materials: &[Material], textures: &[TextureEntry]) {
        for (at, texture) in textures.iter().enumerate() {
            let mut parts = Path::new(&texture.file).components();
            if !matches!((parts.next(), parts.next()), (Some(std::path::Component::Normal(_)), None)) {
                self.add(file, format!("/textures/{at}/file"), format!("'{}' is not a file name", texture.file));
            }
        }
        for (at, material) in materials.iter().enumerate() {
            for Lookup { texture, channel, .. } in material.lookups() {
                if texture.0 >= textures.len() || channel > 2 {
                    let message = format!("no channel {channel} of texture {}", texture.0);
                    self.add(file, format!("/materials/{at}"), message);
                }
            }
        }
    }
}

/// Every index out of range, and every file name that leads out of `textures/`.
fn dangling(file: &ReferenceFile, lights: &LightsFile, nodes: usize) -> Vec<Finding> {
    let mut faults = Faults(Vec::new());
    if file.surfaces.len() != nodes {
        faults.add(
            "reference.json",
            "/surfaces".to_owned(),
            format!("{} surfaces, {nodes} nodes", file.surfaces.len()),
        );
    }
    for (at, surface) in file.surfaces.iter().enumerate() {
        if surface.material.0 >= file.materials.len() {
            faults.add(
                "reference.json",
                format!("/surfaces/{at}/material"),
                format!("no material {}", surface.material.0),
            );
        }
    }
    faults.check_materials("reference.json", &file.materials, &file.textures);
    for (at, group) in lights.groups.iter().enumerate() {
        let sound = match &group.emission {
            Emission::Area { surfaces, map, .. } => {
                surfaces.iter().all(|surface| surface.0 < nodes)
                    && map.is_none_or(|map| map.texture.0 < file.textures.len())
            }
            Emission::Environment { texture, .. } => texture.0 < file.textures.len(),
            Emission::Constant { .. } => true,
        };
        if !sound {
            faults.add("lights.json", format!("/groups/{at}"), "a surface or texture that does not exist".to_owned());
        }
    }
    faults.0
}

/// Reads all instances as opaque surfaces with the uv of their atlases, in the order of `scene.json`. Fails where
/// `instances.glb` cannot be read or holds other instances than `scene.json`.
pub fn read_plain(folder: &SceneFolder, scene: &SceneFile) -> Result<ReferenceScene, DatasetError> {
    let path = folder.instances();
    let nodes = glb::read(&path)?;
    let ids = scene.instances.iter().map(|instance| instance.id.as_str());
    if !(nodes.len() == scene.instances.len() && nodes.iter().map(|node| node.name.as_str()).eq(ids)) {
        let what = "its nodes are not the instances of scene.json; run `mateval prep verify`".to_owned();
        return Err(DatasetError::Unsupported { path, what });
    }
    let surface = |node: glb::GlbNode| Surface { name: node.name, mesh: node.mesh, material: MaterialIndex(0) };
    let grey = Material::new("", MaterialModel::grey(0.5));
    let surfaces = nodes.into_iter().map(surface).collect();
    Ok(ReferenceScene { surfaces, materials: vec![grey], ..ReferenceScene::default() })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::material::{ColorInput, ScalarInput};

    fn scene() -> ReferenceScene {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: None,
            uvs: None,
            triangles: vec![[0, 1, 2]],
        };
        let texture =
            |name: &str, texels| SourceTexture::computed(name, Texture::new(2, 1, texels, Wrap::Clamp).unwrap());
        let uv = Default::default();
        ReferenceScene {
            surfaces: vec![Surface { name: "s".to_owned(), mesh, material: MaterialIndex(0) }],
            materials: vec![Material {
                name: "m".to_owned(),
                model: MaterialModel::Diffuse {
                    reflectance: ColorInput::Texture { texture: TextureIndex(0), uv },
                    alpha: None,
                },
                two_sided: true,
                opacity: Some(ScalarInput::Texture { texture: TextureIndex(3), channel: 0, uv }),
                bump: None,
            }],
            textures: vec![
                texture("a.jpg", Texels::Srgb8(vec![[1, 2, 3], [4, 5, 6]])),
                texture("w.png", Texels::Srgb16(vec![[1, 20_000, 3], [4, 5, 65_535]])),
                texture("b.png", Texels::Linear8(vec![[1, 2, 3], [4, 5, 6]])),
                texture("c.png", Texels::Grey8(vec![7, 9])),
                texture("d.hdr", Texels::Linear(vec![[0.1, 7.0, 1e4], [0.0, 0.0, 1.0]])),
                texture("e.exr", Texels::Grey(vec![0.3, 0.7])),
            ],
            lights: vec![LightGroup {
                name: "l".to_owned(),
                emission: Emission::Area {
                    surfaces: vec![SurfaceIndex(0)],
                    radiance: [1.0, 2.0, 3.0],
                    map: None,
                    two_sided: false,
                },
                camera_visible: true,
            }],
        }
    }

    #[test]
    fn round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let folder = SceneFolder::at(folder.path().to_owned());
        write(&folder, &scene()).unwrap();
        assert_eq!(read(&folder).unwrap(), scene());
    }

    /// A light without a map has no key for it in the file; one with a map is read as it was written.
    #[test]
    fn maps_of_lights() {
        let folder = tempfile::tempdir().unwrap();
        let folder = SceneFolder::at(folder.path().to_owned());
        write(&folder, &scene()).unwrap();
        let text = std::fs::read_to_string(folder.lights()).unwrap();
        let emission = r#""emission":{"type":"area","surfaces":[0],"radiance":[1.0,2.0,3.0],"two_sided":false}"#;
        assert!(text.split_whitespace().collect::<String>().contains(emission), "{text}");

        let mapped = |texture: usize| {
            let mut scene = scene();
            let Emission::Area { map, .. } = &mut scene.lights[0].emission else { unreachable!() };
            let uv = UvTransform([[2.0, 0.0, 0.5], [0.0, -1.0, 1.0]]);
            *map = Some(EmissionMap { texture: TextureIndex(texture), uv });
            scene
        };
        // Its surface has no uv, which is no fault: see dataset_spec/format/truth.md.
        write(&folder, &mapped(5)).unwrap();
        assert_eq!(read(&folder).unwrap(), mapped(5));
        for absent in [6, usize::MAX] {
            write(&folder, &mapped(absent)).unwrap();
            let text = read(&folder).unwrap_err().to_string();
            assert!(text.contains("/groups/0"), "{text}");
        }
    }

    /// Invalid maps are errors that name the file.
    #[test]
    fn hostile_maps() {
        let folder = tempfile::tempdir().unwrap();
        let folder = SceneFolder::at(folder.path().to_owned());
        write(&folder, &scene()).unwrap();
        let text = std::fs::read_to_string(folder.lights()).unwrap();
        let read_with = |map: &str| {
            let text = text.replace("\"radiance\"", &format!("\"map\": {map}, \"radiance\""));
            std::fs::write(folder.lights(), text).unwrap();
            read(&folder).map_err(|error| error.to_string())
        };
        let uv = "[[1, 0, 0], [0, 1, 0]]";
        assert!(read_with(&format!("{{\"texture\": 0, \"uv\": {uv}}}")).is_ok());
        assert_eq!(read_with("null").unwrap(), scene());
        for map in [
            "7".to_owned(),
            "{}".to_owned(),
            format!("{{\"texture\": -1, \"uv\": {uv}}}"),
            format!("{{\"texture\": 1e30, \"uv\": {uv}}}"),
            format!("{{\"texture\": 18446744073709551615, \"uv\": {uv}}}"),
            format!("{{\"texture\": 0, \"uv\": {uv}, \"more\": 1}}"),
            "{\"texture\": 0, \"uv\": [[1, 0], [0, 1]]}".to_owned(),
            "{\"texture\": 0, \"uv\": [[1e999, 0, 0], [0, 1, 0]]}".to_owned(),
        ] {
            let error = read_with(&map).unwrap_err();
            assert!(error.contains("lights.json"), "{map}: {error}");
        }
    }

    #[test]
    fn all_dangling_places_are_named_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let folder = SceneFolder::at(folder.path().to_owned());
        let mut bad = scene();
        bad.surfaces[0].material = MaterialIndex(4);
        bad.materials[0].opacity =
            Some(ScalarInput::Texture { texture: TextureIndex(9), channel: 0, uv: Default::default() });
        bad.lights[0].emission =
            Emission::Area { surfaces: vec![SurfaceIndex(3)], radiance: [1.0; 3], map: None, two_sided: false };
        write(&folder, &bad).unwrap();
        let text = read(&folder).unwrap_err().to_string();
        for place in ["/surfaces/0/material", "/materials/0", "/groups/0"] {
            assert!(text.contains(place), "{text}");
        }
    }
}
