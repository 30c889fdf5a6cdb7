//! Parses untrusted glTF and GLB files, with what the `gltf` crate does not know or refuses: byte order marks, padding
//! with NUL, textures without a picture, `EXT_texture_webp`, accessors without a buffer view, and which parameters of a
//! material the file states.

use gltf::binary::Glb;
use gltf::json::camera::Type;
use gltf::json::validation::{Checked, Error as Fault, Validate};
use mateval_image::file_kind::{hint, without_mark};
use serde_json::{Map, Value};

use crate::gltf_error::GltfError;
use crate::material::StatedParameters;

/// Length of a binary file's header, in bytes.
const GLB_HEADER: u32 = 12;
/// Extensions that are read here or by every reader, and that the gltf crate does not know.
const READ_HERE: [&str; 3] = [WEBP, INSTANCING, "KHR_mesh_quantization"];
const WEBP: &str = "EXT_texture_webp";
/// Copies of a node's mesh. The reader of the nodes makes them.
pub const INSTANCING: &str = "EXT_mesh_gpu_instancing";
const KTX2: &str = "KHR_texture_basisu";
const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// A parsed file.
#[derive(Debug)]
pub struct GltfFile {
    /// The JSON, validated. No material refers to a texture without a picture.
    pub document: gltf::Document,
    /// The binary part of a GLB.
    pub blob: Option<Vec<u8>>,
    /// For each material, which parameters the file states; the others are defaults of the format.
    pub stated: Vec<StatedParameters>,
    /// JSON pointers to references to textures without a picture, which were taken out.
    pub without_picture: Vec<String>,
}

/// The JSON of a file: the first chunk of a GLB as far as the file reaches, or else the whole file.
pub fn json_of(bytes: &[u8]) -> &[u8] {
    const HEADERS: usize = 20;
    let Some(rest) = bytes.strip_prefix(b"glTF").and_then(|_| bytes.get(HEADERS..)) else { return bytes };
    let stated = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    &rest[..stated.min(rest.len())]
}

/// Parses and validates a glTF or GLB file.
pub fn parse(bytes: &[u8]) -> Result<GltfFile, GltfError> {
    let (json, blob) = if bytes.starts_with(b"glTF") { chunks(bytes)? } else { (bytes.to_vec(), None) };
    // Some writers pad the JSON with NUL instead of blanks.
    let text = without_mark(&json);
    let text = &text[..text.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1)];
    let mut file: Value =
        serde_json::from_slice(text).map_err(|reason| GltfError::NotJson { reason, hint: hint(text).into_owned() })?;
    use_webp(&mut file);
    give_scenes_nodes(&mut file);
    require_others_only(&mut file);
    let without_picture = take_textures_without_picture(&mut file)?;
    let stated = list(&file, "materials").iter().map(stated_parameters).collect();
    let root: gltf::json::Root =
        serde_json::from_value(file).map_err(|reason| GltfError::NotJson { reason, hint: String::new() })?;
    let document = checked(root)?;
    Ok(GltfFile { document, blob, stated, without_picture })
}

fn chunks(bytes: &[u8]) -> Result<(Vec<u8>, Option<Vec<u8>>), GltfError> {
    // The gltf crate subtracts the header from the length that a binary file states, without checking that length.
    let stated = bytes.get(8..12).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    if let Some(length) = stated.filter(|length| *length < GLB_HEADER) {
        return Err(GltfError::StatedLength { length });
    }
    let glb = Glb::from_slice(bytes)?;
    Ok((glb.json.into_owned(), glb.bin.map(std::borrow::Cow::into_owned)))
}

fn list<'a>(file: &'a Value, key: &str) -> &'a [Value] {
    file.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// Makes the pictures of `EXT_texture_webp` the textures' own.
fn use_webp(file: &mut Value) {
    for texture in file.get_mut("textures").and_then(Value::as_array_mut).into_iter().flatten() {
        let source = texture.pointer(&format!("/extensions/{WEBP}/source")).cloned();
        if let (Some(source), Some(texture)) = (source, texture.as_object_mut()) {
            texture.insert("source".to_owned(), source);
        }
    }
}

/// Gives a scene without nodes an empty list of them, for which the gltf crate asks.
fn give_scenes_nodes(file: &mut Value) {
    for scene in file.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(scene) = scene.as_object_mut() {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
    }
}

/// Takes the extensions that are read out of the list of those that are required, which the gltf crate checks.
fn require_others_only(file: &mut Value) {
    if let Some(names) = file.get_mut("extensionsRequired").and_then(Value::as_array_mut) {
        names.retain(|name| !name.as_str().is_some_and(|name| READ_HERE.contains(&name)));
    }
}

/// Takes out the references to textures without a picture. Returns their JSON pointers. Fails where the picture exists as
/// KTX2 alone: without it, the material would be another.
fn take_textures_without_picture(file: &mut Value) -> Result<Vec<String>, GltfError> {
    let textures = list(file, "textures");
    let absent: Vec<bool> = textures.iter().map(|texture| texture.get("source").is_none()).collect();
    let is_ktx2 = |texture: &Value| texture.pointer(&format!("/extensions/{KTX2}")).is_some();
    let only_ktx2 = textures.iter().position(|texture| texture.get("source").is_none() && is_ktx2(texture));
    if let Some(texture) = only_ktx2 {
        return Err(GltfError::OnlyKtx2 { texture });
    }
    let mut pointers = Vec::new();
    if !absent.contains(&true) {
        return Ok(pointers);
    }
    for (at, material) in file.get_mut("materials").and_then(Value::as_array_mut).into_iter().flatten().enumerate() {
        take_references(material, &absent, &format!("/materials/{at}"), &mut pointers);
    }
    // The gltf crate asks for a source of every texture; nothing refers to these any more.
    let has_images = !list(file, "images").is_empty();
    if let Some(root) = file.as_object_mut() {
        if !has_images {
            root.insert("images".to_owned(), serde_json::json!([{ "uri": "absent" }]));
        }
        for texture in root.get_mut("textures").and_then(Value::as_array_mut).into_iter().flatten() {
            if let Some(texture) = texture.as_object_mut() {
                texture.entry("source").or_insert(Value::from(0));
            }
        }
    }
    Ok(pointers)
}

/// Takes out every `...Texture: { index: ... }` below a value that refers to an absent texture. The nesting of JSON is
/// bounded by its parser.
fn take_references(value: &mut Value, absent: &[bool], pointer: &str, pointers: &mut Vec<String>) {
    let Some(object) = value.as_object_mut() else { return };
    object.retain(|key, value| {
        let index = value.get("index").and_then(Value::as_u64).and_then(|index| usize::try_from(index).ok());
        let is_taken = key.ends_with("Texture") && index.is_some_and(|index| absent.get(index) == Some(&true));
        if is_taken {
            pointers.push(format!("{pointer}/{key}"));
        }
        !is_taken
    });
    for (key, value) in object.iter_mut() {
        take_references(value, absent, &format!("{pointer}/{key}"), pointers);
    }
}

/// Which parameters a material states, by itself or by `KHR_materials_pbrSpecularGlossiness`.
fn stated_parameters(material: &Value) -> StatedParameters {
    let empty = Map::new();
    let object = |pointer: &str| material.pointer(pointer).and_then(Value::as_object).unwrap_or(&empty);
    let (pbr, own) = (object("/pbrMetallicRoughness"), object(""));
    let any = |object: &Map<String, Value>, keys: &[&str]| keys.iter().any(|key| object.contains_key(*key));
    let emission = any(own, &["emissiveFactor"]);
    let extension = object(&format!("/extensions/{SPECULAR_GLOSSINESS}"));
    if material.pointer(&format!("/extensions/{SPECULAR_GLOSSINESS}")).is_some() {
        let texture = "specularGlossinessTexture";
        return StatedParameters {
            base_color: any(extension, &["diffuseFactor", "diffuseTexture"]),
            roughness: any(extension, &["glossinessFactor", texture]),
            metallic: any(extension, &["specularFactor", texture]),
            emission,
        };
    }
    StatedParameters {
        base_color: any(pbr, &["baseColorFactor", "baseColorTexture"]),
        roughness: any(pbr, &["roughnessFactor", "metallicRoughnessTexture"]),
        metallic: any(pbr, &["metallicFactor", "metallicRoughnessTexture"]),
        emission,
    }
}

/// The document of a root that is valid, apart from accessors without a buffer view, which glTF allows.
fn checked(root: gltf::json::Root) -> Result<gltf::Document, GltfError> {
    // The gltf crate's own validation looks up the accessor of the positions before it checks that the accessor exists.
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    if primitives.flat_map(|primitive| primitive.attributes.values()).any(|at| at.value() >= root.accessors.len()) {
        return Err(GltfError::NoAccessor);
    }
    check_sources(&root)?;
    let mut faults = Vec::new();
    root.validate(&root, gltf::json::Path::new, &mut |path, fault| {
        let path = path();
        let is_zeros = matches!(fault, Fault::Missing)
            && path.as_str().starts_with("accessors[")
            && path.as_str().ends_with("].bufferView");
        if !is_zeros {
            faults.push((path, fault));
        }
    });
    if !faults.is_empty() {
        return Err(gltf::Error::Validation(faults).into());
    }
    Ok(gltf::Document::from_json_without_validation(root))
}

/// Fails where an image states no place of its bytes, or a camera no projection of its type. The gltf crate assumes
/// that they do.
fn check_sources(root: &gltf::json::Root) -> Result<(), GltfError> {
    let has_source = |image: &gltf::json::Image| match image.buffer_view {
        Some(_) => image.mime_type.is_some(),
        None => image.uri.is_some(),
    };
    if let Some(image) = root.images.iter().position(|image| !has_source(image)) {
        return Err(GltfError::NoImageSource { image });
    }
    let has_projection = |camera: &gltf::json::Camera| match camera.type_ {
        Checked::Valid(Type::Perspective) => camera.perspective.is_some(),
        Checked::Valid(Type::Orthographic) => camera.orthographic.is_some(),
        Checked::Invalid => false,
    };
    match root.cameras.iter().position(|camera| !has_projection(camera)) {
        Some(camera) => Err(GltfError::NoProjection { camera }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn parsed(file: Value) -> Result<GltfFile, GltfError> {
        let mut file = file;
        file["asset"] = json!({ "version": "2.0" });
        parse(file.to_string().as_bytes())
    }

    /// Found by fuzzing.
    #[test]
    fn a_binary_file_shorter_than_its_header_is_refused() {
        for length in [0_u32, 11, 12, u32::MAX] {
            let bytes = [&b"glTF"[..], &2_u32.to_le_bytes(), &length.to_le_bytes(), &[0; 8]].concat();
            let found = parse(&bytes).unwrap_err();
            assert_eq!(matches!(found, GltfError::StatedLength { .. }), length < 12, "{found}");
        }
    }

    /// The gltf crate panics where these are looked up.
    #[test]
    fn images_and_cameras_without_content_are_refused() {
        let views = json!([{ "buffer": 0, "byteLength": 1 }]);
        let with = |key: &str, list: Value| {
            parsed(json!({ "buffers": [{ "byteLength": 1 }], "bufferViews": views, key: list }))
        };
        assert!(with("images", json!([{ "uri": "a" }, { "bufferView": 0, "mimeType": "image/png" }])).is_ok());
        for image in [json!({ "bufferView": 0 }), json!({})] {
            let error = with("images", json!([image])).unwrap_err();
            assert!(error.to_string().starts_with("/images/0: "), "{error}");
        }
        let orthographic = json!({ "xmag": 1, "ymag": 1, "zfar": 9, "znear": 0 });
        let camera = with("cameras", json!([{ "type": "perspective", "orthographic": orthographic }]));
        assert!(camera.unwrap_err().to_string().starts_with("/cameras/0: "));
    }

    #[test]
    fn marks_and_padding_are_skipped_and_other_files_named() {
        let text = r#"{"asset":{"version":"2.0"}}"#;
        assert!(parse(format!("\u{feff}{text}").as_bytes()).is_ok());
        assert!(parse(format!("{text}\0\0").as_bytes()).is_ok());
        for (bytes, word) in [(b"version https://git-lfs.github.com".as_slice(), "LFS"), (b"PK\x03\x04", "ZIP")] {
            assert!(parse(bytes).unwrap_err().to_string().contains(word));
        }
    }

    #[test]
    fn a_scene_may_have_no_nodes() {
        assert_eq!(parsed(json!({ "scenes": [{}] })).unwrap().document.scenes().next().unwrap().nodes().len(), 0);
    }

    #[test]
    fn the_webp_picture_becomes_the_textures_own() {
        let webp = json!({ "extensions": { WEBP: { "source": 1 } } });
        let images = json!([{ "uri": "a" }, { "uri": "b" }]);
        let file = parsed(json!({ "textures": [webp], "images": images, "extensionsRequired": [WEBP] })).unwrap();
        assert_eq!(file.document.textures().next().unwrap().source().index(), 1);
    }

    #[test]
    fn textures_without_a_picture_are_absent() {
        let pbr = json!({ "baseColorTexture": { "index": 0 } });
        let with =
            |texture: Value| parsed(json!({ "textures": [texture], "materials": [{ "pbrMetallicRoughness": pbr }] }));
        let file = with(json!({})).unwrap();
        assert_eq!(file.without_picture, ["/materials/0/pbrMetallicRoughness/baseColorTexture"]);
        assert!(file.document.materials().next().unwrap().pbr_metallic_roughness().base_color_texture().is_none());
        assert!(!file.stated[0].base_color);
        let error = with(json!({ "extensions": { KTX2: { "source": 0 } } })).unwrap_err().to_string();
        assert!(error.contains(KTX2) && error.starts_with("/textures/0: "), "{error}");
    }

    #[test]
    fn defaults_are_no_statements() {
        let file = parsed(json!({ "materials": [
            {},
            { "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 1] } },
            { "pbrMetallicRoughness": { "metallicFactor": 0 }, "emissiveFactor": [0, 0, 0] },
            { "extensions": { SPECULAR_GLOSSINESS: { "diffuseFactor": [1, 0, 0, 1] } } },
        ] }));
        let stated =
            |base_color, roughness, metallic, emission| StatedParameters { base_color, roughness, metallic, emission };
        let expected = [
            stated(false, false, false, false),
            stated(true, false, false, false),
            stated(false, false, true, true),
            stated(true, false, false, false),
        ];
        assert_eq!(file.unwrap().stated, expected);
    }
}
