//! glTF files and the contents of their accessors, for untrusted input: nothing is read outside a buffer, and every
//! float must be finite.

use gltf::accessor::DataType;
use gltf::json::camera::Type;
use gltf::json::validation::Checked;

use crate::gltf_error::GltfError;

/// Length of a binary file's header, in bytes.
const GLB_HEADER: u32 = 12;

/// Parses and validates a glTF or GLB file.
pub fn parse(bytes: &[u8]) -> Result<gltf::Gltf, GltfError> {
    // The gltf crate subtracts the header from the length that a binary file states, without checking that length.
    let stated = bytes.strip_prefix(b"glTF").and_then(|rest| rest.get(4..8)).map(word);
    if let Some(length) = stated.filter(|length| *length < GLB_HEADER) {
        return Err(GltfError::StatedLength { length });
    }
    let unchecked = gltf::Gltf::from_slice_without_validation(bytes)?;
    // The gltf crate's own validation looks up the accessor of the positions before it checks that the accessor exists.
    let root = unchecked.document.as_json();
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    if primitives.flat_map(|primitive| primitive.attributes.values()).any(|at| at.value() >= root.accessors.len()) {
        return Err(GltfError::NoAccessor);
    }
    check_sources(root)?;
    Ok(gltf::Gltf::from_slice(bytes)?)
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

/// The entries of an accessor of floats, `N` an entry.
pub fn floats<const N: usize>(accessor: &gltf::Accessor<'_>, buffer: &[u8]) -> Result<Vec<[f32; N]>, GltfError> {
    if accessor.data_type() != DataType::F32 || accessor.dimensions().multiplicity() != N {
        return Err(GltfError::NotFloats { accessor: accessor.index(), expected: N });
    }
    let entry = |entry: &[u8]| std::array::from_fn(|c| f32::from_bits(word(&entry[4 * c..4 * c + 4])));
    let values: Vec<[f32; N]> = entries(accessor, buffer, 4 * N)?.map(entry).collect();
    finite(accessor, values)
}

/// The first `N` numbers of each entry of an accessor of floats, or of normalized integers, which stand for 0 to 1.
pub fn floats_or_shares<const N: usize>(
    accessor: &gltf::Accessor<'_>,
    buffer: &[u8],
) -> Result<Vec<[f32; N]>, GltfError> {
    let (size, largest) = match accessor.data_type() {
        DataType::F32 => (4, 1.0),
        DataType::U16 if accessor.normalized() => (2, f32::from(u16::MAX)),
        DataType::U8 if accessor.normalized() => (1, f32::from(u8::MAX)),
        found => return Err(GltfError::NotShares { accessor: accessor.index(), found }),
    };
    let found = accessor.dimensions().multiplicity();
    if found < N {
        return Err(GltfError::TooFewNumbers { accessor: accessor.index(), expected: N, found });
    }
    let number = |bytes: &[u8]| match size {
        4 => f32::from_bits(word(bytes)),
        _ => word(bytes) as f32 / largest,
    };
    let entry = |entry: &[u8]| std::array::from_fn(|c| number(&entry[size * c..size * (c + 1)]));
    let values: Vec<[f32; N]> = entries(accessor, buffer, size * found)?.map(entry).collect();
    finite(accessor, values)
}

fn finite<const N: usize>(accessor: &gltf::Accessor<'_>, values: Vec<[f32; N]>) -> Result<Vec<[f32; N]>, GltfError> {
    match values.iter().position(|value| !value.iter().all(|v| v.is_finite())) {
        None => Ok(values),
        Some(entry) => Err(GltfError::NotFinite { accessor: accessor.index(), entry }),
    }
}

/// The entries of an accessor of integers.
pub fn indices(accessor: &gltf::Accessor<'_>, buffer: &[u8]) -> Result<Vec<u32>, GltfError> {
    let size = match accessor.data_type() {
        DataType::U32 => 4,
        DataType::U16 => 2,
        DataType::U8 => 1,
        found => return Err(GltfError::NotIndices { accessor: accessor.index(), found }),
    };
    if accessor.dimensions().multiplicity() != 1 {
        return Err(GltfError::NotOneIndex { accessor: accessor.index() });
    }
    Ok(entries(accessor, buffer, size)?.map(word).collect())
}

/// Splits indices into triangles. Fails where one is not below `vertices`, or their number is not a multiple of three.
pub fn triangles(indices: Vec<u32>, vertices: usize) -> Result<Vec<[u32; 3]>, GltfError> {
    if let Some(at) = indices.iter().position(|index| *index as usize >= vertices) {
        return Err(GltfError::IndexOutOfRange { at, index: indices[at], vertices });
    }
    let (triangles, rest) = indices.as_chunks::<3>();
    if rest.is_empty() { Ok(triangles.to_vec()) } else { Err(GltfError::NotTriangles { indices: indices.len() }) }
}

/// The bytes of a buffer view. Fails where it reaches outside its buffer.
pub fn view_bytes<'a>(view: &gltf::buffer::View<'_>, buffer: &'a [u8]) -> Result<&'a [u8], GltfError> {
    let outside = || GltfError::ViewOutside { view: view.index() };
    let start = view.offset();
    start.checked_add(view.length()).and_then(|end| buffer.get(start..end)).ok_or_else(outside)
}

/// The little-endian integer in four bytes or fewer.
fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// The accessor's entries, of `size` bytes each. Fails where they reach outside the buffer.
fn entries<'a>(
    accessor: &gltf::Accessor<'_>,
    buffer: &'a [u8],
    size: usize,
) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, GltfError> {
    let outside = || GltfError::AccessorOutside { accessor: accessor.index() };
    let view = accessor.view().filter(|_| accessor.sparse().is_none()).ok_or(GltfError::Sparse)?;
    let slice = view_bytes(&view, buffer).map_err(|_| outside())?;
    let stride = view.stride().unwrap_or(size).max(size);
    let count = accessor.count();
    let used = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size));
    let end = used.and_then(|used| used.checked_add(accessor.offset())).filter(|end| *end <= slice.len());
    let data = slice.get(accessor.offset()..end.ok_or_else(outside)?).ok_or_else(outside)?;
    Ok((0..count).map(move |index| &data[index * stride..index * stride + size]))
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let view = r#""buffers":[{"byteLength":1}],"bufferViews":[{"buffer":0,"byteLength":1}]"#;
        let with = |part: &str| parse(format!(r#"{{"asset":{{"version":"2.0"}},{view},{part}}}"#).as_bytes());
        assert!(with(r#""images":[{"uri":"a"},{"bufferView":0,"mimeType":"image/png"}]"#).is_ok());
        for image in [r#"{"bufferView":0}"#, "{}"] {
            let error = with(&format!(r#""images":[{image}]"#)).unwrap_err();
            assert!(error.to_string().starts_with("/images/0: "), "{error}");
        }
        let camera = r#""cameras":[{"type":"perspective","orthographic":{"xmag":1,"ymag":1,"zfar":9,"znear":0}}]"#;
        assert!(with(camera).unwrap_err().to_string().starts_with("/cameras/0: "));
    }
}
