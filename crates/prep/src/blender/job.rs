//! A job for `blender_scripts/render.py`: its JSON and the files beside it.
//!
//! In: a reference scene, its instances' parts, views. Out: a folder with `job.json`, meshes as raw little-endian
//! numbers and textures as linear EXR. Textures are decoded here: Cycles interpolates 8-bit sRGB before it decodes
//! it, and we after.

use std::path::Path;

use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, Texels, Texture};
use mateval_scene::material::Material;
use mateval_scene::reference::{LightGroup, ReferenceScene, Surface};
use mateval_scene::reference_io::WrapWord;
use mateval_scene::{Camera, SceneId, TriangleMesh, ViewId, json};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::PrepError;

/// What `format` says in a job.
pub const JOB_FORMAT: &str = "mateval-blender-job/1";
/// What `format` says in a result.
pub const RESULT_FORMAT: &str = "mateval-blender-result/1";

/// `job.json`: a scene, where it is seen from, and how it is to be rendered. Files are relative to its folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlenderJob {
    /// Always `mateval-blender-job/1`.
    pub format: String,
    /// The scene's id.
    pub scene: SceneId,
    /// What there is to see.
    pub surfaces: Vec<JobSurface>,
    /// As in `reference.json`.
    pub materials: Vec<Material>,
    /// What materials and lights look up.
    pub textures: Vec<JobTexture>,
    /// As in `lights.json`.
    pub lights: Vec<LightGroup>,
    /// The views to render.
    pub views: Vec<JobView>,
    /// Samples a pixel of each half.
    pub samples_each_half: u32,
    /// Scatterings after the first hit after which a path is cut, of every kind.
    pub max_bounces: u32,
    /// Threads to render on; 0 for as many as there are.
    pub threads: u32,
}

/// A surface: world space, metres, +Y up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JobSurface {
    /// 32-bit floats, three a vertex.
    pub positions: String,
    /// 32-bit indices, three a triangle, counter-clockwise seen from the front.
    pub triangles: String,
    /// 32-bit floats, three a vertex; null where faces are flat.
    pub normals: Option<String>,
    /// 32-bit floats, two a vertex, v upwards; null where there is none.
    pub uvs: Option<String>,
    /// 16-bit indices, one a triangle: its value in `part.png`.
    pub parts: String,
    /// Its value in `instance.png`.
    pub instance: u16,
    /// Its place in `materials`.
    pub material: usize,
}

/// A texture: linear RGB.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JobTexture {
    /// An EXR file.
    pub file: String,
    /// How it goes on outside 0..1.
    pub wrap: WrapWord,
}

/// A view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JobView {
    /// Its id, and the folder of its pictures.
    pub id: ViewId,
    /// Where it is seen from.
    pub camera: Camera,
    /// Seeds of both halves, below 2^31.
    pub seeds: [u32; 2],
}

/// `result.json`: what the script has made so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlenderResult {
    /// Always `mateval-blender-result/1`.
    pub format: String,
    /// Blender's version.
    pub blender: String,
    /// What Blender renders only nearly as the job says, a line a material.
    pub approximations: Vec<String>,
    /// The views whose pictures are whole.
    pub views: Vec<ResultView>,
    /// Why it ended early; null where it did not, or has not yet.
    pub error: Option<String>,
}

/// A view that is whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultView {
    /// Its id.
    pub id: ViewId,
    /// Seconds that its halves `a` and `b` took, and `denoise`.
    pub seconds: std::collections::BTreeMap<String, f64>,
}

/// What a job renders, its files apart.
#[derive(Clone, Debug)]
pub struct JobPlan<'a> {
    /// The scene's id.
    pub scene: &'a SceneId,
    /// What there is to see; instance k is surface k - 1.
    pub reference: &'a ReferenceScene,
    /// The value in `part.png` of every triangle of every surface.
    pub parts: &'a [Vec<u16>],
    /// The views.
    pub views: Vec<JobView>,
    /// Samples a pixel of each half.
    pub samples_each_half: u32,
    /// Scatterings after which a path is cut.
    pub max_bounces: u32,
    /// Threads; 0 for all.
    pub threads: u32,
}

/// Writes the job into the folder, which must be there.
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
    // 8 bits are well told apart by 16-bit floats; what is stored as floats may be beyond their range.
    let precision = match texture.texels() {
        Texels::Srgb8(_) | Texels::Linear8(_) | Texels::Grey8(_) => Precision::Half,
        Texels::Srgb16(_) | Texels::Linear(_) | Texels::Grey(_) => Precision::Float,
    };
    exr_io::write_linear(&folder.join(&file), &texels, precision)?;
    Ok(JobTexture { file, wrap: WrapWord::from(texture.wrap()) })
}
