//! A glTF parsed within limits on memory, and refused where it requires an unknown extension, by its own statement or
//! because its meshes exist in a compressed form alone.

use gltf::json::validation;
use mateval_image::file_kind::without_mark;
use mateval_scene::findings::shortened;
use mateval_scene::gltf_file::{self, GltfFile, INSTANCING, json_of};
use serde::Deserialize;
use serde_json::Value;

use super::error::GltfSceneError;
use super::limits::Limits;
use crate::json_size::JsonSize;

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
pub(super) fn parse(bytes: &[u8], limits: &Limits) -> Result<GltfFile, GltfSceneError> {
    let json = without_mark(json_of(bytes));
    let JsonSize { values, containers } = JsonSize::of(json);
    if json.len() > limits.json_bytes || values > limits.json_values || containers > limits.json_containers {
        return Err(GltfSceneError::TooLarge {
            bytes: json.len(),
            values,
            containers,
            most_bytes: limits.json_bytes,
            most_values: limits.json_values,
            most_containers: limits.json_containers,
        });
    }
    // JSON that is not valid is reported by the parser of the whole.
    let required = serde_json::from_slice(json).map_or(Vec::new(), |head: Head| head.extensions_required);
    if let Some(name) = required.iter().find(|name| !KNOWN.contains(&name.as_str())) {
        return Err(GltfSceneError::RequiredExtension { name: shortened(name), way_out: way_out(name) });
    }
    let file = gltf_file::parse(bytes)?;
    check_compression(&file)?;
    check_instances(&file.document)?;
    Ok(file)
}

/// Fails where a primitive or a buffer view has no data but compressed ones.
fn check_compression(file: &GltfFile) -> Result<(), GltfSceneError> {
    let only = |pointer, name| Err(GltfSceneError::OnlyCompressed { pointer, name, way_out: way_out(name) });
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
fn check_instances(document: &gltf::Document) -> Result<(), GltfSceneError> {
    let accessors = document.accessors().len() as u64;
    for node in document.nodes() {
        let attributes = node.extension_value(INSTANCING).and_then(|extension| extension.get("attributes"));
        for (name, index) in attributes.and_then(Value::as_object).into_iter().flatten() {
            if index.as_u64().is_none_or(|index| index >= accessors) {
                let pointer = format!("/nodes/{}/extensions/{INSTANCING}/attributes/{}", node.index(), shortened(name));
                return Err(GltfSceneError::NotValid {
                    pointer,
                    reason: validation::Error::IndexOutOfBounds,
                    others: 0,
                });
            }
        }
    }
    Ok(())
}
