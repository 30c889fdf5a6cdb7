//! A job for `blender_scripts/render.py`: its JSON and the files beside it.
//!
//! In: a reference scene, the parts of its instances, views. Out: a folder with `job.json`, meshes as raw little-endian
//! numbers and textures as linear EXR files. Textures are decoded here, since Cycles interpolates 8-bit sRGB before it
//! decodes it, while the built-in tracer decodes first.

use std::path::Path;

use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, Texels, Texture};
use mateval_scene::material::Material;
use mateval_scene::reference::{LightGroup, ReferenceScene, Surface};
use mateval_scene::reference_io::WrapWord;
use mateval_scene::{Camera, SceneId, TriangleMesh, ViewId, json};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::error::PrepError;

/// The value of `format` in a job.
pub const JOB_FORMAT: &str = "mateval-blender-job/1";
/// The value of `format` in a result.
pub const RESULT_FORMAT: &str = "mateval-blender-result/1";

/// `job.json`: a scene, the views to render and the settings. Files are relative to its folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlenderJob {
    /// Always `mateval-blender-job/1`.
    pub format: String,
    /// The scene's id.
    pub scene: SceneId,
    /// The scene's surfaces.
    pub surfaces: Vec<JobSurface>,
    /// Materials as in `reference.json`.
    #[schemars(schema_with = "materials_schema")]
    pub materials: Vec<Material>,
    /// Textures that materials and lights refer to by index.
    pub textures: Vec<JobTexture>,
    /// Light groups as in `lights.json`.
    pub lights: Vec<LightGroup>,
    /// The views to render.
    pub views: Vec<JobView>,
    /// Samples per pixel of each half.
    pub samples_each_half: u32,
    /// Number of scatterings of any kind after the first hit after which a path is cut.
    pub max_bounces: u32,
    /// Number of threads to render with; 0 for one per processor.
    pub threads: u32,
}

/// The schema of `reference.json` defines what a material is.
fn materials_schema(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "items": { "$ref": "reference.schema.json#/$defs/Material" } })
}

/// A surface, in world space: metres, +Y up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JobSurface {
    /// File of positions: 32-bit floats, three per vertex.
    pub positions: String,
    /// File of 32-bit vertex indices, three per triangle, counter-clockwise seen from the front.
    pub triangles: String,
    /// File of normals: 32-bit floats, three per vertex; null where faces are shaded flat.
    pub normals: Option<String>,
    /// File of texture coordinates: 32-bit floats, two per vertex, v upwards; null where there are none.
    pub uvs: Option<String>,
    /// File of 16-bit part indices, one per triangle: its value in `part.png`.
    pub parts: String,
    /// The surface's value in `instance.png`.
    pub instance: u16,
    /// The index of its material in `materials`.
    pub material: usize,
}

/// A texture of linear RGB.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JobTexture {
    /// An EXR file.
    pub file: String,
    /// How it continues outside 0..1.
    pub wrap: WrapWord,
}

/// A view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JobView {
    /// The view's id, and the name of the folder of its pictures.
    pub id: ViewId,
    /// The view's camera.
    pub camera: Camera,
    /// Seeds of the two halves, below 2^31.
    pub seeds: [u32; 2],
}

/// `result.json`: what the script has rendered so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlenderResult {
    /// Always `mateval-blender-result/1`.
    pub format: String,
    /// Blender's version.
    pub blender: String,
    /// What Blender only approximates of the job, one line per material.
    pub approximations: Vec<String>,
    /// The views whose pictures are complete.
    pub views: Vec<ResultView>,
    /// Why the script ended early; null where it has not.
    pub error: Option<String>,
}

/// A view whose pictures are complete.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultView {
    /// The view's id.
    pub id: ViewId,
    /// Seconds that each step took: the halves `a` and `b`, and `denoise`.
    pub seconds: std::collections::BTreeMap<String, f64>,
}

/// What a job is written from.
#[derive(Clone, Debug)]
pub struct JobPlan<'a> {
    /// The scene's id.
    pub scene: &'a SceneId,
    /// The scene. Its surface at position k is the instance with index k + 1.
    pub reference: &'a ReferenceScene,
    /// The value in `part.png` of every triangle of every surface.
    pub parts: &'a [Vec<u16>],
    /// The views to render.
    pub views: Vec<JobView>,
    /// Samples per pixel of each half.
    pub samples_each_half: u32,
    /// Number of scatterings after which a path is cut.
    pub max_bounces: u32,
    /// Number of threads; 0 for one per processor.
    pub threads: u32,
}

/// Writes the job into the folder, which must exist.
pub fn write(folder: &Path, plan: &JobPlan<'_>) -> Result<(), PrepError> {
    for name in ["meshes", "textures"] {
        let path = folder.join(name);
        std::fs::create_dir_all(&path).map_err(PrepError::io("make", path))?;
    }
    let surfaces = plan.reference.surfaces.iter().zip(plan.parts).enumerate();
    let surfaces = surfaces.map(|(at, (surface, parts))| write_surface(folder, at, surface, parts));
    let textures = plan.reference.textures.iter().enumerate();
    let textures = textures.map(|(at, source)| write_texture(folder, at, &source.texture));
    let job = BlenderJob {
        format: JOB_FORMAT.to_owned(),
        scene: plan.scene.clone(),
        surfaces: surfaces.collect::<Result<_, _>>()?,
        materials: plan.reference.materials.clone(),
        textures: textures.collect::<Result<_, _>>()?,
        lights: plan.reference.lights.clone(),
        views: plan.views.clone(),
        samples_each_half: plan.samples_each_half,
        max_bounces: plan.max_bounces,
        threads: plan.threads,
    };
    Ok(json::write(&folder.join("job.json"), &job)?)
}

fn write_surface(folder: &Path, at: usize, surface: &Surface, parts: &[u16]) -> Result<JobSurface, PrepError> {
    let TriangleMesh { positions, triangles, normals, uvs } = &surface.mesh;
    let write = |kind: &str, bytes: Vec<u8>| {
        let name = format!("meshes/{at:05}.{kind}");
        let path = folder.join(&name);
        std::fs::write(&path, bytes).map_err(PrepError::io("write", path)).map(|()| name)
    };
    let normals = normals.as_ref().map(|all| write("normals", floats(all.iter().flat_map(|v| v.to_array()))));
    let uvs = uvs.as_ref().map(|all| write("uvs", floats(all.iter().flat_map(|v| v.to_array()))));
    Ok(JobSurface {
        positions: write("positions", floats(positions.iter().flat_map(|v| v.to_array())))?,
        triangles: write("triangles", triangles.iter().flatten().flat_map(|v| v.to_le_bytes()).collect())?,
        normals: normals.transpose()?,
        uvs: uvs.transpose()?,
        parts: write("parts", parts.iter().flat_map(|v| v.to_le_bytes()).collect())?,
        instance: u16::try_from(at + 1).expect("a dataset has at most 65535 instances"),
        material: surface.material.0,
    })
}

fn floats(values: impl Iterator<Item = f32>) -> Vec<u8> {
    values.flat_map(f32::to_le_bytes).collect()
}

fn write_texture(folder: &Path, at: usize, texture: &Texture) -> Result<JobTexture, PrepError> {
    let file = format!("textures/{at:04}.exr");
    let texels = Picture::from_fn(texture.width(), texture.height(), |x, y| LinearRgb(texture.texel(x, y)));
    // 16-bit floats keep all values of 8 bits distinct; textures stored as floats may exceed their range.
    let precision = match texture.texels() {
        Texels::Srgb8(_) | Texels::Linear8(_) | Texels::Grey8(_) => Precision::Half,
        Texels::Srgb16(_) | Texels::Linear(_) | Texels::Grey(_) => Precision::Float,
    };
    exr_io::write_linear(&folder.join(&file), &texels, precision)?;
    Ok(JobTexture { file, wrap: WrapWord::from(texture.wrap()) })
}
