//! Reads any glTF 2.0 scene: .glb, or .gltf with its buffers and images in files beside it or in the JSON itself.
//!
//! The input is the path of the file; no file outside its folder is read. The output is a [`FileScene`]: instances in
//! world space, their materials as Blender's principled model, lights, and the first perspective camera. Faulty parts
//! of the file, and what a scene cannot represent, are left out or replaced and reported as findings, whose places are
//! JSON pointers. An error means that there is no scene to read.
//!
//! `document` parses the JSON within limits and reads the binary data. `nodes` walks the tree of the default scene and
//! reads its triangles and camera, `materials` and `textures` the surfaces, `punctual` the lights. `reader` is the
//! state that they share, and counts what is not represented.

mod document;
mod materials;
mod nodes;
mod punctual;
mod reader;
#[cfg(test)]
mod tests;
mod textures;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::DVec3;
use mateval_dataset::SceneLights;
use mateval_dataset::reference::{Emission, LightGroup, ReferenceScene};

use crate::log::{Log, UniqueNames};
use crate::open::{Invalid, SourceError, open};
use crate::source_scene::{FileScene, Missing, read_licence, report_shift, shift_of};
use crate::{coincident, uv};
pub use document::Limits;
use reader::{LEFT_OUT, Omission, Reader, report_omitted};

/// The radiance from everywhere that lights a scene whose file has no light.
const DEFAULT_RADIANCE: [f32; 3] = [1.0; 3];

/// Reads the default scene, or else the first scene, of the glTF at `path`. `camera` is the place of the camera that
/// will be used instead of the file's own; it decides with that whether the scene is moved nearer to the origin.
///
/// Fails where the file or one of its buffers cannot be read, the JSON is not valid glTF, breaks `limits` or requires
/// an unknown extension, or the file has no scene.
pub fn read(path: &Path, camera: Option<DVec3>, limits: &Limits) -> Result<FileScene, SourceError> {
    // The file and its buffers.
    let invalid = |invalid: Invalid| invalid.in_file(path);
    let (mut source, name, bytes) = open(path, limits.file_bytes, limits.file_bytes)?;
    let mut file = document::parse(&bytes, limits).map_err(invalid)?;
    drop(bytes);
    let buffers = document::read_buffers(&mut file, &mut source, limits).map_err(invalid)?;
    let mut log = Log::new(name, limits.findings);
    let licence = read_licence(&mut source, &mut log);
    // The scene.
    let document = &file.document;
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let scene = scene.ok_or_else(|| invalid(Invalid::new("/scenes: expected a scene, found none")))?;
    let shift_m = shift_of(camera.or_else(|| nodes::place_of_camera(&file, &scene)).unwrap_or(DVec3::ZERO));
    report_shift(shift_m, &mut log);
    let mut reader = Reader {
        file: &file,
        buffers: &buffers,
        limits: *limits,
        log,
        omitted: BTreeMap::new(),
        source,
        scene: ReferenceScene::default(),
        origins: Vec::new(),
        textures: BTreeMap::new(),
        faulty_images: BTreeSet::new(),
        without_picture: file.without_picture.iter().map(String::as_str).collect(),
        texels: 0,
        materials: BTreeMap::new(),
        primitives: 0,
        triangles: 0,
        vertices: 0,
        light_names: UniqueNames::default(),
        aspect: None,
    };
    reader.report_unused();
    let camera = reader.nodes(&scene, shift_m);
    let lights = default_light(&mut reader);
    // Repairs that concern all of it.
    let Reader { mut scene, mut origins, mut log, omitted, source, aspect, .. } = reader;
    uv::resolve(&mut scene, &mut origins, &mut log);
    uv::report_coarse(&scene, &mut log);
    coincident::separate(&mut scene.surfaces, &mut origins, &mut log);
    report_omitted(omitted, &mut log);
    let files = source.into_files();
    Ok(FileScene {
        scene,
        origins,
        lights,
        camera,
        aspect,
        shift_m,
        findings: log.into_findings(),
        licence,
        missing: Missing::files(&files),
        files,
    })
}

impl Reader<'_> {
    /// Reports the parts of a file that no node shows, and the textures that it only names.
    fn report_unused(&mut self) {
        let file = self.file;
        if file.document.animations().next().is_some() {
            self.omit(Omission::Slight, "animations", "showed the scene at rest", "/animations");
        }
        for scene in file.document.scenes().skip(1) {
            let pointer = format!("/scenes/{}", scene.index());
            self.omit(Omission::Slight, "further scenes", LEFT_OUT, &pointer);
        }
        for pointer in &file.without_picture {
            self.omit(Omission::Visible, "textures that name no picture", "treated them as absent", pointer);
        }
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
