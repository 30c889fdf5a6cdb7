//! A reference scene on disk: `ground_truth/reference/` and `ground_truth/lights.json`.
//!
//! `geometry.glb` holds a node for each surface with its source uv, `textures/` holds decoded texels, so that no
//! machine's picture decoder can change them, and `reference.json` connects the two.

use std::path::Path;

use mateval_image::exr_io::{self, Precision};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Picture, Texels, Texture, Wrap, png_io};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::dataset::FORMAT;
use crate::glb::{self, GlbNode};
use crate::layout::SceneFolder;
use crate::material::{Lookup, Material};
use crate::reference::{Emission, LightGroup, MaterialIndex, ReferenceScene, SourceTexture, Surface};
use crate::source_materials::SourceMaterials;
use crate::{Finding, SceneError, Severity, json};

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

/// One surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurfaceEntry {
    /// Its name in the source.
    pub name: String,
    /// Index of `materials`.
    pub material: MaterialIndex,
}

/// One texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TextureEntry {
    /// The file in `textures/`.
    pub file: String,
    /// The file that it came from, relative to the source, or the name of a computed texture.
    pub source: String,
    /// SHA-256 of that file, hex; null for a computed one.
    pub source_sha256: Option<String>,
    /// How its numbers are stored.
    pub texels: TexelKind,
    /// How it continues outside 0..1: `repeat`, `clamp` or `mirror`.
    pub wrap: WrapWord,
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

/// How a texture continues outside 0..1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WrapWord {
    /// The picture again.
    Repeat,
    /// The border texel.
    Clamp,
    /// Mirrored every other time.
    Mirror,
}

impl From<Wrap> for WrapWord {
    fn from(wrap: Wrap) -> Self {
        match wrap {
            Wrap::Repeat => Self::Repeat,
            Wrap::Clamp => Self::Clamp,
            Wrap::Mirror => Self::Mirror,
        }
    }
}

impl From<WrapWord> for Wrap {
    fn from(word: WrapWord) -> Self {
        match word {
            WrapWord::Repeat => Self::Repeat,
            WrapWord::Clamp => Self::Clamp,
            WrapWord::Mirror => Self::Mirror,
        }
    }
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
pub fn write(folder: &SceneFolder, scene: &ReferenceScene) -> Result<(), SceneError> {
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
pub fn write_source_materials(folder: &SceneFolder, source: &SourceMaterials) -> Result<(), SceneError> {
    let place = folder.source_materials();
    let textures = write_textures(&place, &source.textures)?;
    let file = SourceMaterialsFile { format: FORMAT.to_owned(), materials: source.materials.clone(), textures };
    json::write(&place.join(SOURCE_MATERIALS), &file)
}

/// Reads the files of [`write_source_materials`]; none where the scene has none. Every index out of range is a finding of
/// the error; `count` is the number of the scene's materials.
pub fn read_source_materials(folder: &SceneFolder, count: usize) -> Result<Option<SourceMaterials>, SceneError> {
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
        return Err(SceneError::Invalid { path, findings: faults.0 });
    }
    let textures = read_textures(&place, &file.textures)?;
    Ok(Some(SourceMaterials { materials: file.materials, textures }))
}

/// The name of the file of the source's own materials.
pub const SOURCE_MATERIALS: &str = "materials.json";

/// Reads the files of [`write()`]. Every index out of range is a finding of the error.
pub fn read(folder: &SceneFolder) -> Result<ReferenceScene, SceneError> {
    let reference = folder.reference();
    let path = reference.join("reference.json");
    let file: ReferenceFile = json::read_format(&path, FORMAT)?;
    let lights: LightsFile = json::read_format(&folder.lights(), FORMAT)?;
    let nodes = glb::read(&reference.join("geometry.glb"))?;
    let faults = dangling(&file, &lights, nodes.len());
    if !faults.is_empty() {
        return Err(SceneError::Invalid { path, findings: faults });
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
fn write_textures(place: &Path, textures: &[SourceTexture]) -> Result<Vec<TextureEntry>, SceneError> {
    let folder = place.join("textures");
    std::fs::create_dir_all(&folder).map_err(SceneError::io("make", &folder))?;
    textures.iter().enumerate().map(|(index, source)| write_texture(&folder, index, source)).collect()
}

fn read_textures(place: &Path, entries: &[TextureEntry]) -> Result<Vec<SourceTexture>, SceneError> {
    entries.iter().map(|entry| read_texture_entry(place, entry)).collect()
}

fn write_texture(folder: &Path, index: usize, source: &SourceTexture) -> Result<TextureEntry, SceneError> {
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
    let wrap = texture.wrap().into();
    let file = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(TextureEntry { file, source: source.name.clone(), source_sha256: source.sha256.clone(), texels, wrap })
}

fn read_texture_entry(reference: &Path, entry: &TextureEntry) -> Result<SourceTexture, SceneError> {
    let path = reference.join("textures").join(&entry.file);
    let wrap = entry.wrap.into();
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
        self.0.push(Finding {
            severity: Severity::Error,
            code: "dangling_reference".to_owned(),
            file: file.to_owned(),
            place: place.into(),
            message,
            action: "fetch or build the dataset again".to_owned(),
        });
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

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::material::{ColorInput, MaterialModel, ScalarInput, TextureIndex, UvTransform};
    use crate::mesh::TriangleMesh;
    use crate::reference::{EmissionMap, SurfaceIndex};

    fn scene() -> ReferenceScene {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: None,
            uvs: None,
            triangles: vec![[0, 1, 2]],
        };
        let texture = |name: &str, texels| SourceTexture {
            name: name.to_owned(),
            sha256: None,
            texture: Texture::new(2, 1, texels, Wrap::Clamp).unwrap(),
        };
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
        // Its surface has no uv, which is no fault: see FORMAT.md.
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
