//! Pictures of the glTF extension `EXT_texture_webp`, which the `gltf` crate does not know.

use std::borrow::Cow;

use gltf::binary::Glb;
use serde_json::Value;

/// The extension's name.
const NAME: &str = "EXT_texture_webp";
/// Largest JSON that is changed, in bytes: its parsed form takes several times as much memory.
const MOST_JSON_BYTES: usize = 1 << 26;
/// The bytes of a binary file's header, which states the file's length.
const GLB_HEADER: usize = 12;

/// The same file, in which the extension's pictures are the textures' own and the extension is not required. Any other
/// file, and one that is not sound, is returned as it is.
pub fn with_own_pictures(bytes: &[u8]) -> Cow<'_, [u8]> {
    let changed = if bytes.starts_with(b"glTF") { changed_glb(bytes) } else { changed_json(bytes) };
    changed.map_or(Cow::Borrowed(bytes), Cow::Owned)
}

fn changed_glb(bytes: &[u8]) -> Option<Vec<u8>> {
    let stated: [u8; 4] = bytes.get(8..GLB_HEADER)?.try_into().ok()?;
    // The gltf crate subtracts the header from the stated length without checking that length.
    if (u32::from_le_bytes(stated) as usize) < GLB_HEADER {
        return None;
    }
    let glb = Glb::from_slice(bytes).ok()?;
    let json = changed_json(&glb.json)?;
    Glb { json: Cow::Owned(json), ..glb }.to_vec().ok()
}

/// None where nothing is to be changed.
fn changed_json(json: &[u8]) -> Option<Vec<u8>> {
    let names_it = || json.windows(NAME.len()).any(|word| word == NAME.as_bytes());
    if json.len() > MOST_JSON_BYTES || !names_it() {
        return None;
    }
    let mut file: Value = serde_json::from_slice(json).ok()?;
    for texture in file.get_mut("textures").and_then(Value::as_array_mut).into_iter().flatten() {
        let source = texture.pointer(&format!("/extensions/{NAME}/source")).cloned();
        if let (Some(source), Some(texture)) = (source, texture.as_object_mut()) {
            texture.insert("source".to_owned(), source);
        }
    }
    for list in ["extensionsRequired", "extensionsUsed"] {
        if let Some(names) = file.get_mut(list).and_then(Value::as_array_mut) {
            names.retain(|name| name != NAME);
        }
    }
    serde_json::to_vec(&file).ok()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_extensions_picture_becomes_the_textures_own() {
        let webp = json!({ "extensions": { NAME: { "source": 3 } } });
        let file = json!({ "textures": [webp, { "source": 1 }], "extensionsRequired": [NAME, "KHR_other"] });
        let text = file.to_string();
        let changed: Value = serde_json::from_slice(&with_own_pictures(text.as_bytes())).unwrap();
        assert_eq!((&changed["textures"][0]["source"], &changed["textures"][1]["source"]), (&json!(3), &json!(1)));
        assert_eq!(changed["extensionsRequired"], json!(["KHR_other"]));
    }

    #[test]
    fn other_files_and_rubbish_stay_as_they_are() {
        let long = [b"glTF\x02\0\0\0\x04\0\0\0".as_slice(), NAME.as_bytes()].concat();
        for bytes in [b"{}".as_slice(), b"", b"glTF", NAME.as_bytes(), &long] {
            assert!(matches!(with_own_pictures(bytes), Cow::Borrowed(same) if same == bytes));
        }
    }
}
