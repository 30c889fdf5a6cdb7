//! Renders with Blender's Cycles.
//!
//! In: a reference scene, the parts of its instances, and views. Out: [`BlenderView`]s. Between: a job for
//! `blender_scripts/render.py`, which is a folder with `job.json`, meshes as raw little-endian numbers and textures as
//! linear EXR files; [`mateval_sources::blend::process`] copies the scripts into it, runs Blender and enforces limits;
//! multi-layer EXR files hold the pictures of each view. Textures are decoded here, since Cycles interpolates 8-bit sRGB
//! before it decodes it, while the built-in tracer decodes first.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::material::Material;
use mateval_dataset::reference::{LightGroup, ReferenceScene, Surface};
use mateval_dataset::render_file::{DeviceKind, RenderDevice};
use mateval_dataset::{Camera, SceneId, TriangleMesh, ViewId, json, word_enum};
use mateval_files::FileError;
use mateval_files::work_folder::make_folder;
use mateval_image::exr_io::{self, Precision};
use mateval_image::{ImageError, LinearRgb, Normal, Picture, Texels, Texture, Wrap};
use mateval_sources::blend::process;
pub use mateval_sources::blend::process::{BlenderLimits, BlenderProgram, Ended, tail};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::error::PrepError;

word_enum! {
    /// The device that Blender renders on.
    DeviceChoice, a "device":
    /// The processor.
    Cpu = "cpu",
    /// The first kind of graphics card of this list that Cycles finds, else the processor.
    Auto = "auto",
    /// As [`DeviceKind::Optix`].
    Optix = "optix",
    /// As [`DeviceKind::Cuda`].
    Cuda = "cuda",
    /// As [`DeviceKind::Hip`].
    Hip = "hip",
    /// As [`DeviceKind::Oneapi`].
    Oneapi = "oneapi",
    /// As [`DeviceKind::Metal`].
    Metal = "metal",
}

impl DeviceChoice {
    /// What the device is, in one sentence for a help text.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Cpu => "The processor",
            Self::Auto => "The first kind below that Cycles finds, else the processor, with a message",
            Self::Optix => "An NVIDIA card with its ray-tracing cores",
            Self::Cuda => "An NVIDIA card",
            Self::Hip => "An AMD card",
            Self::Oneapi => "An Intel card",
            Self::Metal => "An Apple card",
        }
    }

    /// Whether pictures that `device` rendered (none: the processor) are what this choice asks for.
    pub fn accepts(self, device: Option<&RenderDevice>) -> bool {
        self == Self::Auto || device.map_or("cpu", |device| device.kind.word()) == self.word()
    }
}

/// A folder with a job that is ready to run.
#[derive(Debug)]
pub struct JobFolder {
    folder: PathBuf,
    script: PathBuf,
    /// Number of light groups of the scene.
    groups: usize,
}

/// An event of a running Blender.
pub enum BlenderEvent<'a> {
    /// Blender printed a line.
    Line(&'a str),
    /// The pictures of a view are complete.
    View(&'a ResultView, &'a BlenderResult, Box<BlenderView>),
}

impl JobFolder {
    /// Writes the job into the folder, which is created if it does not exist.
    pub fn prepare(folder: &Path, plan: &JobPlan<'_>) -> Result<Self, PrepError> {
        make_folder(folder)?;
        write_job(folder, plan)?;
        let script = process::write_scripts(folder)?;
        Ok(Self { folder: folder.to_owned(), script, groups: plan.reference.lights.len() })
    }

    /// The file of everything that Blender prints.
    pub fn log(&self) -> PathBuf {
        self.folder.join("blender.log")
    }

    fn job(&self) -> PathBuf {
        self.folder.join("job.json")
    }

    /// The command that runs the job, as text that a user can repeat in a shell.
    pub fn command_text(&self, program: &BlenderProgram) -> String {
        let command = program.command(&self.script, &self.job());
        let words = std::iter::once(command.get_program()).chain(command.get_args());
        words.map(|word| format!("'{}'", word.to_string_lossy())).collect::<Vec<_>>().join(" ")
    }

    /// Runs Blender until it ends, and calls `on_event` for every line that it prints and for each view as soon as its
    /// pictures are complete.
    pub fn run(
        &self,
        program: &BlenderProgram,
        limits: &BlenderLimits,
        on_event: &mut dyn FnMut(BlenderEvent<'_>) -> Result<(), PrepError>,
    ) -> Result<Ended, PrepError> {
        let result = self.folder.join("result.json");
        match std::fs::remove_file(&result) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(FileError::io("remove", &result)(error).into());
            }
            _ => {}
        }
        let mut reported = 0;
        process::run(program.command(&self.script, &self.job()), &self.log(), limits, &mut |line| match line {
            Some(line) => on_event(BlenderEvent::Line(line)),
            None => {
                let Some(result) = self.result()? else { return Ok(()) };
                for view in result.views.iter().skip(reported) {
                    let pictures = read_view(&self.folder.join(view.id.as_str()), self.groups)?;
                    on_event(BlenderEvent::View(view, &result, Box::new(pictures)))?;
                    reported += 1;
                }
                Ok(())
            }
        })
    }

    /// What the script has recorded so far; none before it has written its first result.
    pub fn result(&self) -> Result<Option<BlenderResult>, PrepError> {
        let path = self.folder.join("result.json");
        if !path.is_file() {
            return Ok(None);
        }
        Ok(Some(json::read_format(&path, RESULT_FORMAT)?))
    }
}

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
    /// The device that renders: `cpu`, `auto`, or a kind of graphics card.
    pub device: DeviceChoice,
    /// What has rendered other views of the scene, which `auto` must take again: `cpu` or a kind of graphics card; null
    /// where nothing has.
    pub required_device: Option<String>,
    /// The position of this process among those that run at once, which take different cards.
    pub turn: u32,
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
    pub wrap: Wrap,
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
    /// The graphics card that renders; null for the processor.
    pub device: Option<RenderDevice>,
    /// What a user should know about the choice of the device.
    pub remark: Option<String>,
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
    pub scene: &'a SceneId,
    /// The scene. Its surface at position k is the instance with index k + 1.
    pub reference: &'a ReferenceScene,
    /// The value in `part.png` of every triangle of every surface.
    pub parts: &'a [Vec<u16>],
    pub views: Vec<JobView>,
    /// Samples per pixel of each half.
    pub samples_each_half: u32,
    /// Number of scatterings after which a path is cut.
    pub max_bounces: u32,
    /// Number of threads; 0 for one per processor.
    pub threads: u32,
    pub device: DeviceChoice,
    /// What has rendered other views of the scene: `None` for nothing, `Some(None)` for the processor.
    pub required_device: Option<Option<DeviceKind>>,
    /// The position of this process among those that run at once.
    pub turn: u32,
}

/// Writes the job into the folder, which must exist.
fn write_job(folder: &Path, plan: &JobPlan<'_>) -> Result<(), PrepError> {
    for name in ["meshes", "textures"] {
        let path = folder.join(name);
        make_folder(&path)?;
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
        device: plan.device,
        required_device: plan.required_device.map(|kind| kind.map_or("cpu", DeviceKind::word).to_owned()),
        turn: plan.turn,
    };
    Ok(json::write(&folder.join("job.json"), &job)?)
}

fn write_surface(folder: &Path, at: usize, surface: &Surface, parts: &[u16]) -> Result<JobSurface, PrepError> {
    let TriangleMesh { positions, triangles, normals, uvs } = &surface.mesh;
    let write = |kind: &str, bytes: Vec<u8>| {
        let name = format!("meshes/{at:05}.{kind}");
        let path = folder.join(&name);
        std::fs::write(&path, bytes).map_err(FileError::io("write", path)).map(|()| name)
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
    Ok(JobTexture { file, wrap: texture.wrap() })
}

/// Pictures of light: under all lights together, and under each light group alone.
#[derive(Clone, Debug, PartialEq)]
pub struct LightPictures {
    /// Linear radiance under all lights.
    pub rgb: Picture<LinearRgb>,
    /// One picture per group of `lights.json`. They add up to `rgb`, except where each was denoised on its own.
    pub groups: Vec<Picture<LinearRgb>>,
}

/// The pictures that Blender makes of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct BlenderView {
    /// Distance along the camera's axis at pixel centres, in metres; 0 for the background.
    pub depth: Picture<f32>,
    /// World-space shading normal at pixel centres; 0 for the background.
    pub normal: Picture<Normal>,
    /// Instance index at pixel centres; 0 for the background.
    pub instance: Picture<u16>,
    /// Part index at pixel centres; 0 for the background.
    pub part: Picture<u16>,
    /// base_color at pixel centres, linear, taken from the materials that are lit; 0 where a material has none.
    pub base_color: Picture<LinearRgb>,
    /// Two halves, rendered independently.
    pub halves: [LightPictures; 2],
    /// The mean of the halves, denoised.
    pub denoised: LightPictures,
}

/// Reads the pictures in the view's folder. Fails where a number is not finite.
fn read_view(folder: &Path, groups: usize) -> Result<BlenderView, ImageError> {
    let geometry = Passes::read(folder.join("geometry.exr"))?;
    let [a, b] = ["a.exr", "b.exr"].map(|name| Passes::read(folder.join(name)));
    let (a, b) = (a?, b?);
    let denoised = Passes::read(folder.join("denoised.exr"))?;
    let instance = geometry.ids("instance")?;
    Ok(BlenderView {
        depth: without_background(&geometry.number("Depth")?, &instance),
        normal: without_background(&geometry.triple("Normal", ["X", "Y", "Z"])?, &instance).map(Normal),
        part: geometry.ids("part")?,
        instance,
        base_color: Passes::read(folder.join("centre.exr"))?.color("base_color")?,
        halves: [a.light(groups)?, b.light(groups)?],
        denoised: denoised.light(groups)?,
    })
}

/// The picture with 0 for the background, where Blender's depth is 10^10.
fn without_background<T: Copy + Default>(picture: &Picture<T>, instance: &Picture<u16>) -> Picture<T> {
    Picture::from_fn(picture.width(), picture.height(), |x, y| match instance.get(x, y) {
        0 => T::default(),
        _ => picture.get(x, y),
    })
}

/// The passes of one file.
struct Passes {
    path: PathBuf,
    channels: BTreeMap<String, Picture<f32>>,
}

impl Passes {
    fn read(path: PathBuf) -> Result<Self, ImageError> {
        let channels = exr_io::read_channels(&path)?;
        Ok(Self { path, channels })
    }

    /// A channel of a pass. Its name in the file may be prefixed with that of the view layer.
    fn channel(&self, pass: &str, channel: &str) -> Result<&Picture<f32>, ImageError> {
        let wanted = format!("{pass}.{channel}");
        let is_it = |name: &str| name == wanted || name.strip_suffix(&wanted).is_some_and(|rest| rest.ends_with('.'));
        let found = self.channels.iter().find(|(name, _)| is_it(name)).map(|(_, picture)| picture);
        let fault = |what: String| ImageError::Invalid { path: self.path.clone(), what };
        let Some(found) = found else {
            let names: Vec<&str> = self.channels.keys().map(String::as_str).collect();
            return Err(fault(format!("expected a channel {wanted}, found {}", names.join(", "))));
        };
        match found.pixels().iter().position(|value| !value.is_finite()) {
            None => Ok(found),
            Some(at) => {
                let (x, y) = (at % found.width(), at / found.width());
                Err(fault(format!("{wanted}: pixel ({x}, {y}) is NaN or infinite; expected finite numbers")))
            }
        }
    }

    fn triple(&self, pass: &str, names: [&str; 3]) -> Result<Picture<[f32; 3]>, ImageError> {
        let [a, b, c] = names.map(|name| self.channel(pass, name));
        let (a, b, c) = (a?, b?, c?);
        Ok(Picture::from_fn(a.width(), a.height(), |x, y| [a.get(x, y), b.get(x, y), c.get(x, y)]))
    }

    fn color(&self, pass: &str) -> Result<Picture<LinearRgb>, ImageError> {
        Ok(self.triple(pass, ["R", "G", "B"])?.map(LinearRgb))
    }

    /// A pass with one channel. Its name depends on the kind of pass: `V`, `Z` or `X`.
    fn number(&self, pass: &str) -> Result<Picture<f32>, ImageError> {
        let first = self.channel(pass, "V");
        let found =
            first.or_else(|error| self.channel(pass, "Z").or_else(|_| self.channel(pass, "X")).map_err(|_| error));
        found.cloned()
    }

    fn ids(&self, pass: &str) -> Result<Picture<u16>, ImageError> {
        // Integers of 16 bits are exact as floats; the cast clamps any other number to 16 bits.
        Ok(self.number(pass)?.map(|value| value.round() as u16))
    }

    fn light(&self, groups: usize) -> Result<LightPictures, ImageError> {
        let group = |at: usize| self.color(&format!("Combined_group_{at:02}"));
        Ok(LightPictures { rgb: self.color("Combined")?, groups: (0..groups).map(group).collect::<Result<_, _>>()? })
    }
}
