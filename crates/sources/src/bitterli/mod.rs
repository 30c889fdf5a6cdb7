//! Reads Bitterli's scenes: Mitsuba XML of versions 0.5, 0.6 and 3, with OBJ meshes and textures beside it.
//!
//! The input is the path of a scene's XML; no file outside its folder is read. The output is a [`BitterliScene`].
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
use mateval_dataset::{Camera, Finding};
use mateval_files::untrusted::{hint, shortened, without_mark};

use crate::coincident;
use crate::error::{InvalidSource, SourceError, open};
use crate::source_scene::{
    InstanceOrigin, LicenceText, Log, Missing, UniqueNames, is_optional, read_licence, report_shift, shift_of,
};
use document::Document;
pub use document::{BitterliError, Limits, ValueError};
use reader::{Reader, Totals};

#[derive(Clone, Debug, PartialEq)]
pub struct BitterliScene {
    /// Name and author from the licence, as in `'Modern Hall' by NewSee2l035`, or else the folder's name.
    pub title: String,
    /// Surfaces, materials, textures and lights, in world space.
    pub scene: ReferenceScene,
    /// Facts about each surface, in the order of `scene.surfaces`.
    pub origins: Vec<InstanceOrigin>,
    /// What was subtracted from the scene's positions, in metres.
    pub shift_m: DVec3,
    /// The first sensor. The picture's size is that of the film's crop window.
    pub camera: Camera,
    /// Everything that was left out, replaced or approximated; sorted.
    pub findings: Vec<Finding>,
    /// The licence file beside the XML, if any.
    pub licence: Option<LicenceText>,
    /// Every file that was read, relative to the XML's folder with forward slashes, and its SHA-256 in hex; sorted.
    pub source_files: Vec<(String, String)>,
    /// Every file that was looked for but is missing; sorted.
    pub absent_files: Vec<String>,
    /// Shapes and textures that are missing.
    pub missing: Missing,
}

/// Reads the scene whose XML is at `xml_path`. `camera` is the place of the camera that will be used instead of the
/// scene's own; it decides with that whether the scene is moved nearer to the origin.
///
/// Fails where the file cannot be read, is not a Mitsuba scene, breaks `limits`, or has no usable camera.
pub fn read(xml_path: &Path, camera: Option<DVec3>, limits: &Limits) -> Result<BitterliScene, SourceError> {
    // The XML as a tree.
    let invalid = |error| SourceError::invalid(xml_path, InvalidSource::Bitterli(error));
    let (mut source, name, bytes) = open(xml_path, limits.xml_bytes, limits.file_bytes)?;
    let text = std::str::from_utf8(without_mark(&bytes))
        .map_err(|_| SourceError::invalid(xml_path, InvalidSource::NotUtf8 { hint: hint(&bytes).into_owned() }))?;
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
    coincident::separate(&mut reader.scene.surfaces, &mut origins, &mut reader.log);
    // Its title, findings and files.
    let title = title(licence.as_ref(), xml_path);
    let Reader { scene, log, source, shift_m, left_out, .. } = reader;
    let files = source.into_files();
    Ok(BitterliScene {
        title,
        scene,
        origins,
        camera,
        shift_m,
        findings: log.into_findings(),
        licence,
        missing: missing(&document, left_out, &files.absent),
        source_files: files.hashes,
        absent_files: files.absent,
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

fn title(licence: Option<&LicenceText>, xml_path: &Path) -> String {
    let first = licence.and_then(|licence| licence.text.lines().next()).unwrap_or("");
    let named = first.split_once("version of ").map(|(_, rest)| rest.split(',').next().unwrap_or(rest).trim());
    if let Some(named) = named.filter(|named| !named.is_empty()) {
        return shortened(named).replace("\\'", "'");
    }
    let folder = xml_path.canonicalize().ok().and_then(|path| path.parent()?.file_name().map(|n| n.to_owned()));
    folder.map_or_else(|| "scene".to_owned(), |name| shortened(&name.to_string_lossy()))
}

/// Reads all elements directly below `<scene>`. Fails where none of them is a usable sensor. `place` is that of the
/// camera that will be used instead.
fn read_elements<'a>(
    reader: &mut Reader<'a>,
    document: &'a Document,
    place: Option<DVec3>,
) -> Result<Camera, BitterliError> {
    // What concerns all others: the folders of files, and the camera, which decides whether the scene is moved.
    let elements = || document.root.children.iter();
    reader.search =
        elements().filter(|e| e.tag == "path").filter_map(|e| e.attribute("value")).map(str::to_owned).collect();
    let sensor = elements().find(|element| element.tag == "sensor").ok_or(BitterliError::NoSensor)?;
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
