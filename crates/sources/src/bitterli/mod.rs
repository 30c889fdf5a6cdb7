//! Reads Bitterli's scenes: Mitsuba XML of versions 0.5, 0.6 and 3, with OBJ meshes and textures beside it.
//!
//! The input is the path of a scene's XML; no file outside its folder is read. The output is a [`FileScene`].
//! Elements that are unknown, missing or faulty are left out or replaced and reported as findings. An error means that
//! there is no scene to read or no camera to look through.
//!
//! `document` parses the XML into a tree: it checks depth and size, substitutes variables and writes names in
//! snake_case. `reader` hands a plugin the parameters it knows and reports the others. Each kind of plugin has its own
//! file: `sensor`, `shape`, `bsdf`, `texture` (with `color`) and `emitter`. Where Mitsuba's documentation is silent,
//! the reader does what Mitsuba 3.9.1 does; the tests cite its results.

mod bsdf;
mod color;
mod document;
mod emitter;
mod reader;
mod sensor;
mod shape;
#[cfg(test)]
pub(crate) mod tests;
mod texture;

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{Camera, SceneLights};
use mateval_files::untrusted::{hint, shortened, without_mark};

use crate::log::{Log, UniqueNames};
use crate::open::{Invalid, SourceError, open};
use crate::source_scene::{FileScene, InstanceOrigin, Missing, is_optional, read_licence, report_shift, shift_of};
use crate::{coincident, uv};
use document::Document;
pub use document::Limits;
use reader::{Reader, Totals};

/// Reads the scene whose XML is at `xml_path`. `camera` is the place of the camera that will be used instead of the
/// scene's own; it decides with that whether the scene is moved nearer to the origin.
///
/// Fails where the file cannot be read, is not a Mitsuba scene, breaks `limits`, or has no usable camera.
pub fn read(xml_path: &Path, camera: Option<DVec3>, limits: &Limits) -> Result<FileScene, SourceError> {
    // The XML as a tree.
    let invalid = |invalid: Invalid| invalid.in_file(xml_path);
    let (mut source, name, bytes) = open(xml_path, limits.xml_bytes, limits.file_bytes)?;
    let text = std::str::from_utf8(without_mark(&bytes))
        .map_err(|_| invalid(Invalid(format!("expected UTF-8, found other bytes{}", hint(&bytes)))))?;
    let mut log = Log::new(name, limits.findings);
    let document = Document::parse(text, limits, &mut source, &mut log).map_err(invalid)?;
    let ids = document.ids(&mut log);
    let licence = read_licence(&mut source, &mut log);
    // The scene.
    let mut reader = Reader {
        ids,
        major_version: document.major_version,
        limits: *limits,
        log,
        source,
        search: Vec::new(),
        left_out: Vec::new(),
        shift_m: DVec3::ZERO,
        scene: ReferenceScene::default(),
        textures: BTreeMap::new(),
        texels: 0,
        alphas: BTreeMap::new(),
        stated: Vec::new(),
        materials: BTreeMap::new(),
        totals: Totals::default(),
        has_environment: false,
        light_names: UniqueNames::default(),
    };
    let camera = read_elements(&mut reader, &document, camera).map_err(invalid)?;
    report_unused(&mut reader, &document);
    let mut origins = vec![InstanceOrigin::default(); reader.scene.surfaces.len()];
    for (origin, surface) in origins.iter_mut().zip(&reader.scene.surfaces) {
        origin.stated = reader.stated[surface.material.0];
    }
    uv::report_coarse(&reader.scene, &mut reader.log);
    coincident::separate(&mut reader.scene.surfaces, &mut origins, &mut reader.log);
    let Reader { scene, log, source, shift_m, left_out, .. } = reader;
    let files = source.into_files();
    Ok(FileScene {
        scene,
        origins,
        lights: SceneLights::Own,
        camera: Some(camera),
        aspect: None,
        shift_m,
        findings: log.into_findings(),
        licence,
        missing: missing(&document, left_out, &files.absent),
        files,
    })
}

/// Of the scene's shapes and textures, those that are missing. The file of a shape counts as the shape.
fn missing(document: &Document, left_out: Vec<String>, absent: &[String]) -> Missing {
    let count = |tag: &str| document.root.children.iter().filter(|element| element.tag == tag).count();
    let is_picture = |file: &&String| !is_optional(file) && !file.to_lowercase().ends_with(".obj");
    let pictures: Vec<String> = absent.iter().filter(is_picture).cloned().collect();
    let wanted = count("shape") + count("bsdf") + count("emitter");
    Missing { what: "shapes and textures", wanted, files: [left_out, pictures].concat() }
}

/// Reads all elements directly below `<scene>`. Fails where none of them is a usable sensor. `place` is that of the
/// camera that will be used instead.
fn read_elements<'a>(reader: &mut Reader<'a>, document: &'a Document, place: Option<DVec3>) -> Result<Camera, Invalid> {
    // What concerns all others: the folders of files, and the camera, which decides whether the scene is moved.
    let elements = || document.root.children.iter();
    reader.search =
        elements().filter(|e| e.tag == "path").filter_map(|e| e.attribute("value")).map(str::to_owned).collect();
    let sensor = elements()
        .find(|element| element.tag == "sensor")
        .ok_or_else(|| Invalid::new("expected a <sensor>, found none"))?;
    let camera = reader.sensor(sensor)?;
    reader.shift_m = shift_of(place.unwrap_or(camera.position()));
    report_shift(reader.shift_m, &mut reader.log);
    let mut shapes = 0;
    for element in &document.root.children {
        match element.tag.as_str() {
            "shape" if shapes < reader.limits.shapes => {
                shapes += 1;
                reader.shape(element);
            }
            "shape" => {
                let message = format!("the scene has more than {} shapes", reader.limits.shapes);
                reader.log.warn("limit", "", message, "left the rest out");
            }
            "sensor" if element.serial == sensor.serial => {}
            "sensor" => reader.log.warn("unsupported", &element.place(), "a second sensor", "used the first one"),
            "emitter" => reader.scene_emitter(element),
            "medium" => reader.log.warn("unsupported", &element.place(), "a medium", "ignored it"),
            "bsdf" | "texture" | "integrator" | "sampler" | "film" | "alias" | "path" => {}
            other => {
                let message = format!("line {}: <{}> is not known", element.line, shortened(other));
                reader.log.warn("unknown_element", &element.place(), message, "ignored");
            }
        }
    }
    Ok(if reader.shift_m == DVec3::ZERO { camera } else { camera.moved(-reader.shift_m) })
}

/// Reports BSDFs that no shape uses. One of them can be a `bumpmap` around the BSDF that has the id: references resolve
/// to the element with the id, so such bumps do not show in Mitsuba either.
fn report_unused(reader: &mut Reader, document: &Document) {
    for element in document.root.children.iter().filter(|e| e.tag == "bsdf") {
        if reader.materials.contains_key(&element.serial) {
            continue;
        }
        let inner = element.children.iter().find(|c| c.tag == "bsdf" && reader.materials.contains_key(&c.serial));
        let (message, action) = match inner {
            Some(inner) => (
                format!("shapes refer to the inner {}, not to this {}", inner.place(), element.kind()),
                format!("left the {} out, as Mitsuba does", element.kind()),
            ),
            None => ("no shape uses this bsdf".to_owned(), "left it out".to_owned()),
        };
        reader.log.note("unused_bsdf", &element.place(), message, action);
    }
}
