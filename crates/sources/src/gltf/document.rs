//! A glTF parsed within limits on memory, with its buffers and the files that it names. It is refused where it requires
//! an unknown extension, by its own statement or because its meshes exist in a compressed form alone. Places are JSON
//! pointers (RFC 6901).

use mateval_dataset::gltf_file::{self, GltfFile, INSTANCING, json_of};
use mateval_files::source_folder::{FileFault, SourceFolder};
use mateval_files::untrusted::{shortened, without_mark};
use serde::Deserialize;
use serde_json::Value;

use crate::open::Invalid;
use crate::open::check_json;

/// Limits on an untrusted glTF, checked before memory is taken. The file is refused where its JSON or its buffers
/// exceed them; anything else is left out, which is a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the glTF, of any other file, and of all buffers together.
    pub file_bytes: u64,
    pub json_bytes: usize,
    /// Values in the JSON: numbers, texts, lists, objects.
    pub json_values: usize,
    /// Lists and objects in the JSON, each of which takes more memory than a number.
    pub json_containers: usize,
    /// Primitives of all nodes; a mesh counts as often as nodes show it.
    pub primitives: usize,
    /// Triangles of all instances; a mesh counts as often as nodes show it, even if it turns out to be faulty.
    pub triangles: usize,
    /// Vertices of all instances, counted like triangles.
    pub vertices: usize,
    /// Texels of all textures.
    pub texels: usize,
    /// Number of lights. Each is rendered apart, so that the light of a view can be weighted anew.
    pub lights: usize,
    /// Number of findings. Further ones are only counted.
    pub findings: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 2 << 30,
            json_bytes: 64 << 20,
            json_values: 4 << 20,
            json_containers: 1 << 20,
            primitives: 200_000,
            triangles: 20_000_000,
            vertices: 30_000_000,
            texels: 512 << 20,
            lights: 128,
            findings: 5_000,
        }
    }
}

/// The extensions that may be required. Others change the meaning of the rest of the file.
const KNOWN: [&str; 10] = [
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

const DRACO: &str = "KHR_draco_mesh_compression";
const MESHOPT: &str = "EXT_meshopt_compression";
/// The name under which newer writers use [`MESHOPT`].
const KHR_MESHOPT: &str = "KHR_meshopt_compression";

/// What to do about an extension that is not read.
fn way_out(extension: &str) -> &'static str {
    match extension {
        "KHR_texture_basisu" => "convert its textures with `gltf-transform ktxdecompress`",
        DRACO | MESHOPT | KHR_MESHOPT => {
            "export it without compression of meshes, or import it in Blender and export it again"
        }
        _ => "export the file without it",
    }
}

/// The keys that are read before all others.
#[derive(Deserialize)]
struct Head {
    #[serde(default, rename = "extensionsRequired")]
    extensions_required: Vec<String>,
}

/// Parses a .gltf or .glb. Fails where it is not valid, exceeds `limits`, or requires an unknown extension.
/// Whoever writes a compressed file must require the extension, unless the file holds the same meshes uncompressed.
pub(super) fn parse(bytes: &[u8], limits: &Limits) -> Result<GltfFile, Invalid> {
    let json = without_mark(json_of(bytes));
    if json.len() > limits.json_bytes {
        return Err(Invalid(format!("expected JSON of at most {} bytes, found {}", limits.json_bytes, json.len())));
    }
    check_json(json, limits.json_values, limits.json_containers)?;
    // JSON that is not valid is reported by the parser of the whole.
    let required = serde_json::from_slice(json).map_or(Vec::new(), |head: Head| head.extensions_required);
    if let Some(name) = required.iter().find(|name| !KNOWN.contains(&name.as_str())) {
        let (name, way_out) = (shortened(name), way_out(name));
        return Err(Invalid(format!("/extensionsRequired: '{name}' is not supported; {way_out}")));
    }
    let file = gltf_file::parse(bytes)?;
    check_compression(&file)?;
    check_instances(&file.document)?;
    Ok(file)
}

/// Fails where a primitive or a buffer view has no data but compressed ones.
fn check_compression(file: &GltfFile) -> Result<(), Invalid> {
    let only = |pointer: String, name| {
        let what = format!("its data are compressed ('{name}'), which is not supported; {}", way_out(name));
        Err(Invalid(format!("{pointer}: {what}")))
    };
    for mesh in file.document.meshes() {
        for primitive in mesh.primitives().filter(|primitive| primitive.extension_value(DRACO).is_some()) {
            // An accessor without a buffer view would read as zeros.
            let positions = primitive.get(&gltf::Semantic::Positions);
            if positions.into_iter().chain(primitive.indices()).any(|accessor| accessor.view().is_none()) {
                return only(format!("/meshes/{}/primitives/{}", mesh.index(), primitive.index()), DRACO);
            }
        }
    }
    for view in file.document.views() {
        let name = [MESHOPT, KHR_MESHOPT].into_iter().find(|name| view.extension_value(name).is_some());
        let Some(name) = name else { continue };
        // A fallback buffer has neither a file nor the binary part of a .glb, which is the first buffer.
        let buffer = view.buffer();
        let is_binary_part = buffer.index() == 0 && file.blob.is_some();
        if matches!(buffer.source(), gltf::buffer::Source::Bin) && !is_binary_part {
            return only(format!("/bufferViews/{}", view.index()), name);
        }
    }
    Ok(())
}

/// Fails where an attribute of instances names an accessor that does not exist, as the gltf crate does for meshes.
fn check_instances(document: &gltf::Document) -> Result<(), Invalid> {
    let accessors = document.accessors().len() as u64;
    for node in document.nodes() {
        let attributes = node.extension_value(INSTANCING).and_then(|extension| extension.get("attributes"));
        for (name, index) in attributes.and_then(Value::as_object).into_iter().flatten() {
            if index.as_u64().is_none_or(|index| index >= accessors) {
                let pointer = format!("/nodes/{}/extensions/{INSTANCING}/attributes/{}", node.index(), shortened(name));
                return Err(Invalid(format!("{pointer}: {}", gltf::json::validation::Error::IndexOutOfBounds)));
            }
        }
    }
    Ok(())
}

/// Reads all buffers. The binary part of a .glb is moved out of `file`.
pub(super) fn read_buffers(
    file: &mut GltfFile,
    folder: &mut SourceFolder,
    limits: &Limits,
) -> Result<Vec<Vec<u8>>, Invalid> {
    let mut blob = file.blob.take();
    let mut buffers = Vec::new();
    let mut total = 0_u64;
    for buffer in file.document.buffers() {
        let number = buffer.index();
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => blob
                .take()
                .ok_or_else(|| Invalid(format!("/buffers/{number}: expected a `uri`, or a .glb with a binary part")))?,
            gltf::buffer::Source::Uri(uri) => {
                read_uri(uri, folder).map_err(|fault| Invalid(format!("/buffers/{number}/uri: {fault}")))?.0
            }
        };
        total = total.saturating_add(bytes.len() as u64);
        if total > limits.file_bytes {
            return Err(Invalid(format!(
                "/buffers: expected at most {} bytes together, found more",
                limits.file_bytes
            )));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// The bytes that a URI names, and the file's name relative to the folder; none for base64 in the URI itself.
pub(super) fn read_uri(uri: &str, folder: &mut SourceFolder) -> Result<(Vec<u8>, Option<String>), FileFault> {
    let fault = |message: String| FileFault { code: "bad_uri", message };
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, encoded) = data
            .split_once(";base64,")
            .ok_or_else(|| fault(format!("expected `data:...;base64,...`, found '{}'", shortened(uri))))?;
        let bytes = base64::decode(encoded).map_err(|error| fault(format!("not base64: {error}")))?;
        return Ok((bytes, None));
    }
    let name = percent_encoding::percent_decode_str(uri)
        .decode_utf8()
        .map_err(|_| fault(format!("expected UTF-8, found '{}'", shortened(uri))))?;
    let relative = SourceFolder::relative(&name)?;
    Ok((folder.read(&relative)?, Some(relative)))
}
