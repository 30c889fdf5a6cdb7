//! Parses untrusted glTF and GLB files, with what the `gltf` crate does not know or refuses: byte order marks, padding
//! with NUL, textures without a picture, `EXT_texture_webp`, accessors without a buffer view, and which parameters of a
//! material the file states.
//!
//! Nothing is read outside a buffer. Accessors may be sparse, without a buffer view (all zeros), or quantized
//! (`KHR_mesh_quantization`).

use std::collections::BTreeMap;

use glam::{DMat4, DVec3};
use gltf::accessor::DataType;
use gltf::accessor::sparse::IndexType;
use gltf::binary::Glb;
use gltf::json::camera::Type;
use gltf::json::validation::{Checked, Error as Fault, Validate};
use mateval_files::untrusted::{hint, without_mark};
use serde_json::{Map, Value};

use crate::material::StatedParameters;
use mateval_files::untrusted::shortened;

/// Why a glTF file, or a part of it, cannot be read: what was expected, with its place, and what was found. Accessors and
/// buffer views are named by their index in the file.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct GltfError(pub String);

impl GltfError {
    fn not_valid(reason: impl std::fmt::Display) -> Self {
        Self(format!("not valid glTF: {reason}"))
    }
}

/// Length of a binary file's header, in bytes.
const GLB_HEADER: u32 = 12;
/// Extensions that are read here or by every reader, and that the gltf crate does not know.
const READ_HERE: [&str; 3] = [WEBP, INSTANCING, "KHR_mesh_quantization"];
const WEBP: &str = "EXT_texture_webp";
/// Copies of a node's mesh. The reader of the nodes makes them.
pub const INSTANCING: &str = "EXT_mesh_gpu_instancing";
const KTX2: &str = "KHR_texture_basisu";
const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

#[derive(Debug)]
pub struct GltfFile {
    /// The JSON, validated. No material refers to a texture without a picture.
    pub document: gltf::Document,
    pub blob: Option<Vec<u8>>,
    /// For each material, which parameters the file states; the others are defaults of the format.
    pub stated: Vec<StatedParameters>,
    /// JSON pointers to references to textures without a picture, which were taken out.
    pub without_picture: Vec<String>,
    /// By node: the translation, as the file states it, of a node that lies far from its parent. The gltf crate rounds it
    /// to 32 bits, which are too coarse there.
    far: BTreeMap<usize, [f64; 3]>,
}

/// A translation longer than this, in metres, is far: there, 32 bits are coarser than 0.06 mm.
const FAR_M: f64 = 1000.0;

impl GltfFile {
    /// The transform of a node with its exact translation.
    pub fn exact(&self, node: &gltf::Node<'_>, rounded: DMat4) -> DMat4 {
        let exact = self.far.get(&node.index()).map(|translation| DVec3::from_array(*translation).extend(1.0));
        DMat4 { w_axis: exact.unwrap_or(rounded.w_axis), ..rounded }
    }
}

/// The translations of nodes that lie far from their parents.
fn far_translations(file: &Value) -> BTreeMap<usize, [f64; 3]> {
    let translation = |node: &Value| -> Option<[f64; 3]> {
        let from = node.get("matrix").and_then(Value::as_array).and_then(|all| all.get(12..15));
        let from = from.or_else(|| node.get("translation")?.as_array().map(Vec::as_slice))?;
        let numbers: Vec<f64> = from.iter().filter_map(Value::as_f64).collect();
        <[f64; 3]>::try_from(numbers).ok().filter(|found| DVec3::from_array(*found).length() > FAR_M)
    };
    let nodes = list(file, "nodes").iter().enumerate();
    nodes.filter_map(|(at, node)| Some((at, translation(node)?))).collect()
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
        serde_json::from_slice(text).map_err(|reason| GltfError::not_valid(format!("{reason}{}", hint(text))))?;
    use_webp(&mut file);
    give_scenes_nodes(&mut file);
    require_others_only(&mut file);
    let without_picture = take_textures_without_picture(&mut file)?;
    let stated = list(&file, "materials").iter().map(stated_parameters).collect();
    let far = far_translations(&file);
    let root: gltf::json::Root = serde_json::from_value(file).map_err(GltfError::not_valid)?;
    let document = checked(root)?;
    Ok(GltfFile { document, blob, stated, without_picture, far })
}

fn chunks(bytes: &[u8]) -> Result<(Vec<u8>, Option<Vec<u8>>), GltfError> {
    // The gltf crate subtracts the header from the length that a binary file states, without checking that length.
    let stated = bytes.get(8..12).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    if let Some(length) = stated.filter(|length| *length < GLB_HEADER) {
        let what = format!("a binary file that states a length of {length} bytes; its header alone has {GLB_HEADER}");
        return Err(GltfError::not_valid(what));
    }
    if let Some(stated) = stated.filter(|length| *length as usize > bytes.len()) {
        let what = format!("a binary file that states a length of {stated} bytes and has {}", bytes.len());
        return Err(GltfError::not_valid(what));
    }
    let glb = Glb::from_slice(bytes).map_err(GltfError::not_valid)?;
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

/// Takes out the references to textures without a picture. Returns their JSON pointers. Fails where the picture exists
/// in the format of an extension alone, as KTX2: without it, the material would be another.
fn take_textures_without_picture(file: &mut Value) -> Result<Vec<String>, GltfError> {
    let textures = list(file, "textures");
    let absent: Vec<bool> = textures.iter().map(|texture| texture.get("source").is_none()).collect();
    for (at, texture) in textures.iter().enumerate().filter(|(_, texture)| texture.get("source").is_none()) {
        let extensions = texture.get("extensions").and_then(Value::as_object).into_iter().flatten();
        let with_picture = extensions.filter(|(_, extension)| extension.get("source").is_some());
        let Some(name) = with_picture.map(|(name, _)| name.as_str()).next() else { continue };
        let what = if name == KTX2 {
            let way_out = "convert the file with `gltf-transform ktxdecompress`";
            format!("its only picture is KTX2 ({KTX2}), which is not read; {way_out}")
        } else {
            let name = shortened(name);
            format!(
                "its only picture is that of the extension '{name}', which is not read; convert the pictures to PNG"
            )
        };
        return Err(GltfError(format!("/textures/{at}: {what}")));
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
        return Err(GltfError::not_valid("an attribute names an accessor that does not exist"));
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
    let Some((path, reason)) = faults.first() else {
        return Ok(gltf::Document::from_json_without_validation(root));
    };
    let more = match faults.len() - 1 {
        0 => String::new(),
        1 => ", and 1 more fault".to_owned(),
        more => format!(", and {more} more faults"),
    };
    // A path of the gltf crate, as in `meshes[0].name`, becomes the JSON pointer `/meshes/0/name`.
    let pointer = path.as_str().replace(['.', '['], "/").replace([']', '"'], "");
    Err(GltfError(format!("{}: {reason}{more}", shortened(&format!("/{pointer}")))))
}

/// Fails where an image states no place of its bytes, or a camera no projection of its type. The gltf crate assumes
/// that they do.
fn check_sources(root: &gltf::json::Root) -> Result<(), GltfError> {
    let has_source = |image: &gltf::json::Image| match image.buffer_view {
        Some(_) => image.mime_type.is_some(),
        None => image.uri.is_some(),
    };
    if let Some(image) = root.images.iter().position(|image| !has_source(image)) {
        return Err(GltfError(format!("/images/{image}: expected `uri`, or `bufferView` and `mimeType`")));
    }
    let has_projection = |camera: &gltf::json::Camera| match camera.type_ {
        Checked::Valid(Type::Perspective) => camera.perspective.is_some(),
        Checked::Valid(Type::Orthographic) => camera.orthographic.is_some(),
        Checked::Invalid => false,
    };
    match root.cameras.iter().position(|camera| !has_projection(camera)) {
        Some(camera) => Err(GltfError(format!("/cameras/{camera}: expected a projection of the camera's type"))),
        None => Ok(()),
    }
}

/// The most bytes of one accessor's contents. One without a buffer view takes none in the file.
const MOST_BYTES: usize = 1 << 31;

/// The entries of an accessor of `N` numbers each, which may be NaN. Normalized integers stand for 0 to 1, or for -1 to
/// 1 (glTF 2.0, section 3.6.2.2), other integers for themselves.
pub fn numbers<const N: usize>(
    accessor: &gltf::Accessor<'_>,
    buffers: &[impl AsRef<[u8]>],
) -> Result<Vec<[f32; N]>, GltfError> {
    check_numbers(accessor, N, |found| found == N)?;
    first_numbers(accessor, buffers)
}

/// The number of numbers an entry.
fn check_numbers(
    accessor: &gltf::Accessor<'_>,
    expected: usize,
    fits: impl Fn(usize) -> bool,
) -> Result<usize, GltfError> {
    let (index, found) = (accessor.index(), accessor.dimensions().multiplicity());
    let refused = || GltfError(format!("accessor {index}: expected {expected} numbers an entry, found {found}"));
    if fits(found) { Ok(found) } else { Err(refused()) }
}

/// As [`numbers`], of accessors that may have more than `N` numbers per entry; the first `N` count.
pub fn first_numbers<const N: usize>(
    accessor: &gltf::Accessor<'_>,
    buffers: &[impl AsRef<[u8]>],
) -> Result<Vec<[f32; N]>, GltfError> {
    let found = check_numbers(accessor, N, |found| found >= N)?;
    let (data_type, normalized) = (accessor.data_type(), accessor.normalized());
    let share = |value: f32, most: f32| if normalized { (value / most).max(-1.0) } else { value };
    let number = |bytes: &[u8]| match data_type {
        DataType::F32 => f32::from_bits(word(bytes)),
        DataType::I8 => share(f32::from(bytes[0] as i8), 127.0),
        DataType::U8 => share(f32::from(bytes[0]), 255.0),
        DataType::I16 => share(f32::from(word(bytes) as i16), 32767.0),
        DataType::U16 => share(f32::from(word(bytes) as u16), 65535.0),
        DataType::U32 => word(bytes) as f32,
    };
    let size = data_type.size();
    let bytes = entries(accessor, buffers, size * found)?;
    let entry = |entry: &[u8]| std::array::from_fn(|c| number(&entry[size * c..size * (c + 1)]));
    Ok(bytes.chunks_exact(size * found).map(entry).collect())
}

/// The entries of an accessor of integers.
pub fn indices(accessor: &gltf::Accessor<'_>, buffers: &[impl AsRef<[u8]>]) -> Result<Vec<u32>, GltfError> {
    let size = match accessor.data_type() {
        DataType::U32 => 4,
        DataType::U16 => 2,
        DataType::U8 => 1,
        found => return Err(GltfError(format!("accessor {}: expected indices, found {found:?}", accessor.index()))),
    };
    if accessor.dimensions().multiplicity() != 1 {
        return Err(GltfError(format!("accessor {}: expected one index an entry", accessor.index())));
    }
    Ok(entries(accessor, buffers, size)?.chunks_exact(size).map(word).collect())
}

/// Splits indices into triangles. Fails where one is not below `vertices`, or their number is not a multiple of three.
pub fn triangles(indices: Vec<u32>, vertices: usize) -> Result<Vec<[u32; 3]>, GltfError> {
    if let Some(at) = indices.iter().position(|index| *index as usize >= vertices) {
        return Err(GltfError(format!("index {at} is {}, expected less than {vertices}", indices[at])));
    }
    let (triangles, rest) = indices.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(GltfError(format!("{} indices, expected three a triangle", indices.len())));
    }
    Ok(triangles.to_vec())
}

/// The bytes of a buffer view. Fails where it reaches outside its buffer.
pub fn view_bytes<'a>(view: &gltf::buffer::View<'_>, buffers: &'a [impl AsRef<[u8]>]) -> Result<&'a [u8], GltfError> {
    let outside = || GltfError(format!("buffer view {} reaches outside its buffer", view.index()));
    let buffer = buffers.get(view.buffer().index()).ok_or_else(outside)?.as_ref();
    let start = view.offset();
    start.checked_add(view.length()).and_then(|end| buffer.get(start..end)).ok_or_else(outside)
}

/// The little-endian integer in four bytes or fewer.
fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// The accessor's entries, of `size` bytes each, one after the other. Fails where they reach outside a buffer.
fn entries(accessor: &gltf::Accessor<'_>, buffers: &[impl AsRef<[u8]>], size: usize) -> Result<Vec<u8>, GltfError> {
    let (index, count) = (accessor.index(), accessor.count());
    let too_large = || GltfError(format!("accessor {index}: expected at most {MOST_BYTES} bytes, found more"));
    let bytes = count.checked_mul(size).filter(|bytes| *bytes <= MOST_BYTES).ok_or_else(too_large)?;
    // The entries of the buffer view, or zeros.
    let mut all = match accessor.view() {
        Some(view) => strided(index, &view, buffers, accessor.offset(), count, size)?,
        None => vec![0; bytes],
    };
    // Those that a sparse accessor replaces.
    if let Some(sparse) = accessor.sparse() {
        let (numbers, values) = (sparse.indices(), sparse.values());
        let number_size = match numbers.index_type() {
            IndexType::U8 => 1,
            IndexType::U16 => 2,
            IndexType::U32 => 4,
        };
        let replaced = sparse.count();
        let places = strided(index, &numbers.view(), buffers, numbers.offset(), replaced, number_size)?;
        let values = strided(index, &values.view(), buffers, values.offset(), replaced, size)?;
        for (place, value) in places.chunks_exact(number_size).map(word).zip(values.chunks_exact(size)) {
            let start = place as usize * size;
            let target = all.get_mut(start..start + size);
            target.ok_or_else(|| outside(index))?.copy_from_slice(value);
        }
    }
    Ok(all)
}

fn outside(accessor: usize) -> GltfError {
    GltfError(format!("accessor {accessor} reaches outside its buffer"))
}

/// `count` entries of `size` bytes from `offset` of a buffer view on, without the gaps between them.
fn strided(
    accessor: usize,
    view: &gltf::buffer::View<'_>,
    buffers: &[impl AsRef<[u8]>],
    offset: usize,
    count: usize,
    size: usize,
) -> Result<Vec<u8>, GltfError> {
    let slice = view_bytes(view, buffers).map_err(|_| outside(accessor))?;
    let stride = view.stride().unwrap_or(size).max(size);
    let used = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size));
    let end = used.and_then(|used| used.checked_add(offset)).filter(|end| *end <= slice.len());
    let data = slice.get(offset..end.ok_or_else(|| outside(accessor))?).ok_or_else(|| outside(accessor))?;
    Ok((0..count).flat_map(|at| &data[at * stride..at * stride + size]).copied().collect())
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
            assert_eq!(found.to_string().contains("its header alone has 12"), length < 12, "{found}");
            assert_eq!(found.to_string().contains("and has 20"), length == u32::MAX, "{found}");
        }
    }

    #[test]
    fn far_translations_keep_their_digits() {
        let matrix = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -354123.495, 1]);
        let file = parsed(json!({ "nodes": [
            { "translation": [448231.137, 0, 0.1] }, { "matrix": matrix }, { "translation": [0.1, 0, 999] }, {},
        ] }));
        let file = file.unwrap();
        let found = file.document.nodes().map(|node| file.exact(&node, DMat4::IDENTITY).w_axis.truncate());
        let far = [DVec3::new(448231.137, 0.0, 0.1), DVec3::new(0.0, 0.0, -354123.495)];
        assert_eq!(found.collect::<Vec<_>>(), [far[0], far[1], DVec3::ZERO, DVec3::ZERO]);
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
        for extension in [KTX2, "EXT_texture_avif", "MSFT_texture_dds"] {
            let error = with(json!({ "extensions": { extension: { "source": 0 } } })).unwrap_err().to_string();
            assert!(error.contains(extension) && error.starts_with("/textures/0: "), "{error}");
        }
        // Twin: an extension that holds no picture.
        assert!(with(json!({ "extensions": { "EXT_other": {} } })).is_ok());
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
