//! Has Blender bake a `.blend` scene to textures and write it as glTF, by `blender_scripts/bake_blend.py`.
//!
//! In: the file, which is untrusted, and its folder, which holds everything that it may name. Out: a GLB, the light
//! from outside, and what could not be kept. No Python of the file is run. `process` runs Blender, also for renders.

pub mod process;

use std::path::{Path, PathBuf};

use mateval_dataset::material::{Material, MaterialModel};
use mateval_dataset::reference::{Emission, LightGroup, SourceTexture, SurfaceIndex};
use mateval_dataset::{DatasetError, Finding, Role, SceneLights, Severity, json};
use mateval_files::FileError;
use mateval_files::work_folder::make_folder;
use mateval_image::Wrap;
use mateval_image::texture_io::{Encoding, read_texture};
use serde::{Deserialize, Serialize};

use crate::open::SourceError;
use crate::source_scene::FileScene;
use process::{BAKE_SCRIPT, BlenderLimits, BlenderProgram, Ended, run, tail, write_scripts};

const JOB_FORMAT: &str = "mateval-bake/1";
const RESULT_FORMAT: &str = "mateval-baked/1";
/// Bytes of the log that an error shows.
const SHOWN_LOG: u64 = 2000;

/// The job. Lengths are in metres.
#[derive(Serialize)]
struct Job<'a> {
    format: &'static str,
    blend: &'a Path,
    folder: &'a Path,
    out: &'a Path,
    /// Edge of a texture where `texel_m` is null.
    texels: u32,
    texel_m: Option<f64>,
    most_texels: u32,
    samples: u32,
    world_rows: u32,
    threads: u32,
    most_instances: u32,
    most_triangles: u32,
    most_baked_texels: u64,
}

/// What Blender has made of the file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baked {
    #[serde(rename = "format")]
    _format: String,
    /// Blender's version.
    pub blender: String,
    /// The GLB in the output's folder; absent if the file is refused.
    pub glb: Option<String>,
    /// The light from outside; absent if the file has none.
    pub world: Option<BakedWorld>,
    /// Area lamps, which are emitting rectangles in the GLB.
    pub lamps: Vec<BakedLamp>,
    pub materials: Vec<BakedMaterial>,
    /// Files that the scene needs besides its own, relative to its folder.
    pub files: Vec<String>,
    /// What was left out, replaced or approximated.
    pub findings: Vec<BakedFinding>,
    pub faults: Vec<BakedFinding>,
    pub error: Option<String>,
}

/// The light from outside, in the axes of glTF.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub enum BakedWorld {
    /// The same radiance from everywhere.
    Constant {
        /// Linear Rec. 709.
        radiance: [f32; 3],
    },
    /// A latitude-longitude map.
    Map {
        /// An EXR file in the output's folder.
        image: String,
        /// Rotation of the map into the world.
        world_from_environment: [[f32; 3]; 3],
    },
}

/// An area lamp.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BakedLamp {
    /// The name of its node.
    pub node: String,
    pub visible: bool,
}

/// A material of the GLB. What else the script states of it is for people.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct BakedMaterial {
    /// Its name in the GLB.
    pub name: String,
    /// `constant`, `picture`, `baked` or `unstated`.
    pub base_color: String,
}

/// A finding of the script.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BakedFinding {
    pub code: String,
    /// The object or material.
    pub place: String,
    /// What was expected and what was found.
    pub message: String,
    /// What was done.
    pub action: String,
}

impl BakedFinding {
    /// The finding about the file `file`.
    pub fn of_file(&self, file: &str) -> Finding {
        let Self { code, place, message, action } = self.clone();
        Finding::new(Severity::Warning, &code, file, place, message, action)
    }
}

/// Why a `.blend` file was not baked.
#[derive(Debug, thiserror::Error)]
pub enum BakeFault {
    #[error(
        "a .blend file is read by Blender, and none was found; install it with `mateval fetch blender`, or name it with --blender"
    )]
    NoBlender,
    #[error("the .blend file is refused:{}", Finding::list(.0))]
    Refused(Vec<Finding>),
    #[error("Blender did not bake the file: {what}; its log ends with:\n{log}")]
    Failed { what: String, log: String },
}

/// Bakes the file `blend` into `out`, which is created. Textures have texels of `texel_m`.
pub fn bake(
    program: &BlenderProgram,
    limits: &BlenderLimits,
    blend: &Path,
    texel_m: f64,
    out: &Path,
    on_line: &mut dyn FnMut(&str),
) -> Result<Result<(PathBuf, Baked), BakeFault>, SourceError> {
    // Blender has another working folder.
    let absolute = |path: &Path| std::path::absolute(path).map_err(FileError::io("resolve", path));
    let (blend, out) = (absolute(blend)?, absolute(out)?);
    make_folder(&out)?;
    let script = write_scripts(&out)?.with_file_name(BAKE_SCRIPT);
    let file = blend.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let job = Job {
        format: JOB_FORMAT,
        blend: &blend,
        folder: blend.parent().unwrap_or(&blend),
        out: &out,
        texels: 1024,
        texel_m: Some(texel_m),
        most_texels: 4096,
        samples: 16,
        world_rows: 512,
        threads: rayon::current_num_threads() as u32,
        most_instances: 20_000,
        most_triangles: 20_000_000,
        most_baked_texels: 512 << 20,
    };
    let (job_file, log, result) = (out.join("job.json"), out.join("blender.log"), out.join("result.json"));
    json::write(&job_file, &job)?;
    let ended = run(program.command(&script, &job_file), &log, limits, &mut |line| {
        line.into_iter().for_each(&mut *on_line);
        Ok::<_, FileError>(())
    })?;
    // The result says more than the exit code, as far as the script came.
    let failed = |what: String| Ok(Err(BakeFault::Failed { what, log: tail(&log, SHOWN_LOG) }));
    if !result.is_file() {
        return failed(ended.to_string());
    }
    let baked = Baked::read(&result)?;
    if !baked.faults.is_empty() {
        return Ok(Err(BakeFault::Refused(baked.faults.iter().map(|fault| fault.of_file(&file)).collect())));
    }
    let is_done = matches!(ended, Ended::Itself(status) if status.success());
    match (&baked.error, &baked.glb) {
        (None, Some(glb)) if is_done => Ok(Ok((out.join(glb), baked))),
        (Some(error), _) => failed(error.clone()),
        _ => failed(ended.to_string()),
    }
}

impl Baked {
    /// Reads the script's result, whose files lie beside it. Fails where it is not a result, names a file elsewhere, or
    /// holds light that no file of Blender can have.
    pub fn read(path: &Path) -> Result<Self, SourceError> {
        let baked: Self = json::read_format(path, RESULT_FORMAT)?;
        let image = match &baked.world {
            Some(BakedWorld::Map { image, .. }) => Some(image),
            _ => None,
        };
        let is_beside = |name: &&String| !name.contains(['/', '\\', ':']) && !matches!(name.as_str(), "" | "." | "..");
        let bad = match &baked.world {
            _ if !baked.glb.iter().chain(image).all(|name| is_beside(&name)) => "the name of a file in its own folder",
            Some(BakedWorld::Constant { radiance }) if !radiance.iter().all(|v| v.abs() <= MOST_RADIANCE) => {
                "a radiance of at most 1e9"
            }
            Some(BakedWorld::Map { world_from_environment, .. }) if !is_rotation(*world_from_environment) => {
                "a rotation of the environment"
            }
            _ => return Ok(baked),
        };
        let wrong = std::io::Error::new(std::io::ErrorKind::InvalidData, format!("expected {bad}"));
        Err(FileError::io("read", path)(wrong).into())
    }

    /// Adds to the scene of the GLB, which lies in the folder `out`, what glTF does not have: the light from outside,
    /// lamps without a body, and which base colours nobody states.
    pub fn complete(&self, read: &mut FileScene, out: &Path) -> Result<(), SourceError> {
        add_world(read, self, out)?;
        hide_lamps(read, self);
        let is_unstated = |material: &&BakedMaterial| material.base_color == "unstated";
        let unstated: Vec<&str> = self.materials.iter().filter(is_unstated).map(|m| m.name.as_str()).collect();
        for (surface, origin) in read.scene.surfaces.iter().zip(&mut read.origins) {
            let name = read.scene.materials[surface.material.0].name.as_str();
            origin.stated.base_color &= !unstated.contains(&name);
        }
        Ok(())
    }
}

/// Brighter light is a fault.
const MOST_RADIANCE: f32 = 1e9;

/// Whether the rows are orthonormal, but for rounding.
fn is_rotation(rows: [[f32; 3]; 3]) -> bool {
    let product = |a: usize, b: usize| rows[a].iter().zip(rows[b]).map(|(x, y)| x * y).sum::<f32>();
    let pairs = (0..3).flat_map(|a| (0..3).map(move |b| (a, b)));
    pairs.into_iter().all(|(a, b)| (product(a, b) - f32::from(u8::from(a == b))).abs() < 1e-3)
}

/// Replaces the light of a glTF without lights by the file's own light from outside.
fn add_world(read: &mut FileScene, baked: &Baked, out: &Path) -> Result<(), SourceError> {
    if read.lights == SceneLights::Stage {
        read.scene.lights.clear();
        read.findings.retain(|finding| finding.code != "no_light");
        read.lights = SceneLights::Own;
    }
    let emission = match &baked.world {
        None => return Ok(()),
        Some(BakedWorld::Constant { radiance }) if radiance.iter().all(|v| *v <= 0.0) => return Ok(()),
        Some(BakedWorld::Constant { radiance }) => Emission::Constant { radiance: radiance.map(|v| v.max(0.0)) },
        Some(BakedWorld::Map { image, world_from_environment }) => {
            let texture = read_texture(&out.join(image), Encoding::Linear, Wrap::Repeat).map_err(DatasetError::from)?;
            let texture = read.scene.add_texture(SourceTexture::computed("world", texture));
            Emission::Environment { texture, scale: 1.0, world_from_environment: *world_from_environment }
        }
    };
    read.scene.lights.push(LightGroup { name: "world".to_owned(), emission, camera_visible: true });
    Ok(())
}

/// Makes area lamps what they are in Blender: light that has no body.
fn hide_lamps(read: &mut FileScene, baked: &Baked) {
    for lamp in &baked.lamps {
        let Some(at) = read.scene.surfaces.iter().position(|surface| surface.name == lamp.node) else { continue };
        read.scene.surfaces[at].material = read.scene.add_material(Material::new("light", MaterialModel::clear()));
        read.origins[at].role = Role::LightFixture {};
        let is_its = |light: &&mut LightGroup| match &light.emission {
            Emission::Area { surfaces, .. } => surfaces.contains(&SurfaceIndex(at)),
            _ => false,
        };
        for light in read.scene.lights.iter_mut().filter(is_its) {
            light.camera_visible = lamp.visible;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_read_and_others_refused() {
        let text = r#"{"format": "mateval-baked/1", "blender": "4.5.15 LTS", "glb": "scene.glb",
            "world": {"radiance": [0, 0, 0.5]}, "lamps": [{"node": "Lamp", "visible": false}],
            "materials": [{"name": "a", "source": null, "base_color": "unstated", "roughness": "constant", "texels": 64}],
            "files": [], "findings": [{"code": "omitted", "place": "a", "message": "b", "action": "c"}], "faults": [],
            "error": null}"#;
        let parse = |text: &str| json::parse_format::<Baked>(Path::new("result.json"), text.as_bytes(), RESULT_FORMAT);
        let baked = parse(text).unwrap();
        assert_eq!(baked.world, Some(BakedWorld::Constant { radiance: [0.0, 0.0, 0.5] }));
        assert_eq!(
            (baked.materials[0].base_color.as_str(), baked.findings[0].of_file("f").place.as_str()),
            ("unstated", "a")
        );
        for bad in
            [text.replace("baked/1", "baked/9"), text.replace("\"lamps\"", "\"lamp\""), text.replace("0.5]", "0.5")]
        {
            assert!(parse(&bad).is_err());
        }
        // Nor are results that name files elsewhere, or light that is none.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Baked::read(&path)
        };
        let map = |image: &str, first: &str| {
            let rows = format!("[[{first}, 0, 0], [0, 0, 1], [0, -1, 0]]");
            let world = format!(r#"{{"image": "{image}", "world_from_environment": {rows}}}"#);
            text.replace(r#"{"radiance": [0, 0, 0.5]}"#, &world)
        };
        assert!(read(text).is_ok() && read(&map("world.exr", "1")).is_ok());
        for bad in [
            text.replace("scene.glb", "../scene.glb"),
            text.replace("scene.glb", ""),
            text.replace("0.5]", "1e39]"),
            map("/etc/world.exr", "1"),
            map("..", "1"),
            map("world.exr", "1e30"),
            map("world.exr", "2"),
        ] {
            assert!(read(&bad).is_err(), "{bad}");
        }
    }
}
