//! The JSON of a glTF: parsed within limits on memory, and refused where it requires an unknown extension.

use gltf::Gltf;
use mateval_scene::findings::shortened;
use mateval_scene::gltf_accessor;
use mateval_scene::gltf_webp::with_own_pictures;
use serde::Deserialize;

use super::error::GltfSceneError;
use super::limits::Limits;
use crate::json_size::JsonSize;

/// The extensions that may be required. Others change the meaning of the rest of the file.
const KNOWN: [&str; 7] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_texture_transform",
    "EXT_texture_webp",
];

/// The keys that are read before all others.
#[derive(Deserialize)]
struct Head {
    #[serde(default, rename = "extensionsRequired")]
    extensions_required: Vec<String>,
}

/// Parses a .gltf or .glb. Fails where it is not valid, exceeds `limits`, or requires an unknown extension.
pub(super) fn parse(bytes: &[u8], limits: &Limits) -> Result<Gltf, GltfSceneError> {
    let json = json_of(bytes);
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
        return Err(GltfSceneError::RequiredExtension { name: shortened(name) });
    }
    Ok(gltf_accessor::parse(&with_own_pictures(bytes))?)
}

/// The JSON of a file: the first chunk of a .glb, as far as the file reaches, or else the whole file.
fn json_of(bytes: &[u8]) -> &[u8] {
    const HEADERS: usize = 20;
    let Some(rest) = bytes.strip_prefix(b"glTF").and_then(|_| bytes.get(HEADERS..)) else { return bytes };
    let stated = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    &rest[..stated.min(rest.len())]
}
