//! A glTF parsed within limits on memory, and refused where it requires an unknown extension.

use mateval_image::file_kind::without_mark;
use mateval_scene::findings::shortened;
use mateval_scene::gltf_file::{self, GltfFile, json_of};
use serde::Deserialize;

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

/// What to do about an extension that is not read.
fn way_out(extension: &str) -> &'static str {
    match extension {
        "KHR_texture_basisu" => "convert its textures with `gltf-transform ktxdecompress`",
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" => {
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
    Ok(gltf_file::parse(bytes)?)
}
