//! Reads any glTF 2.0 scene: .glb, or .gltf with its buffers and images in files beside it or in the JSON itself.
//!
//! The input is the path of the file; no file outside its folder is read. The output is a [`GltfScene`]: instances in
//! world space, their materials as Blender's principled model, lights, and the first perspective camera. Faulty parts
//! of the file, and what a scene cannot represent, are left out or replaced and reported as findings, whose places are
//! JSON pointers. An error means that there is no scene to read.
//!
//! `document` parses the JSON within limits, and `buffers` reads the binary data, both with `uri` for files. `nodes`
//! walks the tree of the default scene: `meshes` reads triangles, `materials` and `textures` (with `lookup`) the
//! surfaces, `camera` the camera and `punctual` the lights. `reader` is the state that they share, `omitted` counts
//! what is not represented.

mod buffers;
mod camera;
mod document;
mod error;
mod limits;
mod lookup;
mod materials;
mod meshes;
mod nodes;
mod omitted;
mod punctual;
mod read_material;
mod reader;
#[cfg(test)]
mod tests;
mod texture_key;
mod textures;
mod uri;

use std::path::Path;

use mateval_scene::reference::{Emission, LightGroup, ReferenceScene};
use mateval_scene::{Camera, Finding, SceneLights};

use crate::error::{InvalidSource, SourceError};
use crate::licence::read_licence;
use crate::log::Log;
use crate::source_scene::{InstanceOrigin, LicenceText};
pub use error::GltfSceneError;
pub use limits::Limits;
use omitted::{LEFT_OUT, Omission};
use reader::Reader;

/// The radiance from everywhere that lights a scene whose file has no light.
const DEFAULT_RADIANCE: [f32; 3] = [1.0; 3];

/// A scene of a glTF file.
#[derive(Clone, Debug, PartialEq)]
pub struct GltfScene {
    /// Surfaces, materials, textures and lights, in world space.
    pub scene: ReferenceScene,
    /// Facts about each surface, in the order of `scene.surfaces`.
    pub origins: Vec<InstanceOrigin>,
    /// Whether the file has lights of its own.
    pub lights: SceneLights,
    /// The first perspective camera of the scene. glTF states no picture size; it has 480 columns.
    pub camera: Option<Camera>,
    /// Everything that was left out, replaced or approximated; sorted.
    pub findings: Vec<Finding>,
    /// The licence file beside the glTF, if any.
    pub licence: Option<LicenceText>,
    /// Every file that was read, relative to the glTF's folder with forward slashes, and its SHA-256 in hex; sorted.
    pub source_files: Vec<(String, String)>,
    /// Every file that was looked for but is missing; sorted.
    pub absent_files: Vec<String>,
}

/// Reads the default scene, or else the first scene, of the glTF at `path`.
///
/// Fails where the file or one of its buffers cannot be read, the JSON is not valid glTF, breaks `limits` or requires
/// an unknown extension, or the file has no scene.
pub fn read(path: &Path, limits: &Limits) -> Result<GltfScene, SourceError> {
    // The file and its buffers.
    let invalid = |error| SourceError::invalid(path, InvalidSource::Gltf(error));
    let (mut source, name, bytes) = crate::source_scene::open(path, limits.file_bytes, limits.file_bytes)?;
    let mut file = document::parse(&bytes, limits).map_err(invalid)?;
    drop(bytes);
    let buffers = buffers::read(&mut file, &mut source, limits).map_err(invalid)?;
    let mut log = Log::new(name, limits.findings);
    let licence = read_licence(&mut source, &mut log);
    // The scene.
    let scene = file.default_scene().or_else(|| file.scenes().next());
    let scene = scene.ok_or_else(|| invalid(GltfSceneError::NoScene))?;
    let mut reader = Reader::new(&buffers, limits, log, source);
    report_unused(&mut reader, &file);
    let camera = reader.nodes(&scene);
    let lights = default_light(&mut reader);
    // Its findings and files.
    let Reader { scene, origins, mut log, omitted, source, .. } = reader;
    omitted.report(&mut log);
    let files = source.into_files();
    Ok(GltfScene {
        scene,
        origins,
        lights,
        camera,
        findings: log.into_findings(),
        licence,
        source_files: files.hashes,
        absent_files: files.absent,
    })
}

/// Reports the parts of a file that no node shows.
fn report_unused(reader: &mut Reader<'_>, file: &gltf::Document) {
    if file.animations().next().is_some() {
        reader.omit(Omission::Slight, "animations", "showed the scene at rest", "/animations");
    }
    for scene in file.scenes().skip(1) {
        let pointer = format!("/scenes/{}", scene.index());
        reader.omit(Omission::Slight, "further scenes", LEFT_OUT, &pointer);
    }
}

/// Lights a scene without lights evenly from outside, as viewers of glTF do, and reports it.
fn default_light(reader: &mut Reader<'_>) -> SceneLights {
    if !reader.scene.lights.is_empty() {
        return SceneLights::Own;
    }
    let action = "lit the scene with radiance 1 from everywhere outside, which does not reach into closed rooms";
    reader.log.warn("no_light", "", "the file has no light", action);
    let emission = Emission::Constant { radiance: DEFAULT_RADIANCE };
    reader.scene.lights.push(LightGroup { name: "outside".to_owned(), emission, camera_visible: true });
    SceneLights::Stage
}
