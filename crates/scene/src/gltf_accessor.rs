//! glTF files and what their accessors hold, read without trust: nothing outside their buffer, nothing that is not finite. Errors are in
//! words.

use gltf::accessor::DataType;

/// The bytes of a binary file's header.
const GLB_HEADER: u32 = 12;

/// A glTF or GLB file, checked.
pub fn parse(bytes: &[u8]) -> Result<gltf::Gltf, String> {
    let invalid = |error: gltf::Error| format!("no sound glTF: {error}");
    // gltf takes its header from the length that a binary file says it has, before it looks at that.
    let said = bytes.strip_prefix(b"glTF").and_then(|rest| rest.get(4..8)).map(word);
    if let Some(said) = said.filter(|said| *said < GLB_HEADER) {
        return Err(format!("no sound glTF: a binary file of {said} bytes, as it says itself"));
    }
    let unchecked = gltf::Gltf::from_slice_without_validation(bytes).map_err(invalid)?;
    // gltf's own check looks the places' accessor up before it knows that there is one.
    let root = unchecked.document.as_json();
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    if primitives.flat_map(|primitive| primitive.attributes.values()).any(|at| at.value() >= root.accessors.len()) {
        return Err("no sound glTF: an attribute names an accessor that is not there".to_owned());
    }
    gltf::Gltf::from_slice(bytes).map_err(invalid)
}

/// An accessor of floats, `N` an entry.
pub fn floats<const N: usize>(accessor: &gltf::Accessor<'_>, buffer: &[u8]) -> Result<Vec<[f32; N]>, String> {
    if accessor.data_type() != DataType::F32 || accessor.dimensions().multiplicity() != N {
        return Err(format!("accessor {}: expected {N} floats an entry", accessor.index()));
    }
    let entry = |entry: &[u8]| std::array::from_fn(|c| f32::from_bits(word(&entry[4 * c..4 * c + 4])));
    let values: Vec<[f32; N]> = entries(accessor, buffer, 4 * N)?.map(entry).collect();
    if let Some(at) = values.iter().position(|value| !value.iter().all(|v| v.is_finite())) {
        return Err(format!("accessor {}: entry {at} is not finite", accessor.index()));
    }
    Ok(values)
}

/// An accessor of floats, or of whole numbers that stand for 0 to 1: the first `N` of each entry.
pub fn floats_or_shares<const N: usize>(accessor: &gltf::Accessor<'_>, buffer: &[u8]) -> Result<Vec<[f32; N]>, String> {
    let (size, largest) = match accessor.data_type() {
        DataType::F32 => (4, 1.0),
        DataType::U16 if accessor.normalized() => (2, f32::from(u16::MAX)),
        DataType::U8 if accessor.normalized() => (1, f32::from(u8::MAX)),
        other => return Err(format!("accessor {}: expected floats or shares, found {other:?}", accessor.index())),
    };
    let found = accessor.dimensions().multiplicity();
    if found < N {
        return Err(format!("accessor {}: expected {N} numbers an entry, found {found}", accessor.index()));
    }
    let number = |bytes: &[u8]| match size {
        4 => f32::from_bits(word(bytes)),
        _ => word(bytes) as f32 / largest,
    };
    let entry = |entry: &[u8]| std::array::from_fn(|c| number(&entry[size * c..size * (c + 1)]));
    let values: Vec<[f32; N]> = entries(accessor, buffer, size * found)?.map(entry).collect();
    if values.iter().flatten().all(|v| v.is_finite()) {
        Ok(values)
    } else {
        Err(format!("accessor {}: an entry is not finite", accessor.index()))
    }
}

/// An accessor of whole numbers.
pub fn indices(accessor: &gltf::Accessor<'_>, buffer: &[u8]) -> Result<Vec<u32>, String> {
    let size = match accessor.data_type() {
        DataType::U32 => 4,
        DataType::U16 => 2,
        DataType::U8 => 1,
        other => return Err(format!("accessor {}: expected indices, found {other:?}", accessor.index())),
    };
    if accessor.dimensions().multiplicity() != 1 {
        return Err(format!("accessor {}: expected one index an entry", accessor.index()));
    }
    Ok(entries(accessor, buffer, size)?.map(word).collect())
}

/// Indices of a mesh with that many vertices, three a triangle.
pub fn triangles(indices: Vec<u32>, vertices: usize) -> Result<Vec<[u32; 3]>, String> {
    if let Some(at) = indices.iter().position(|index| *index as usize >= vertices) {
        return Err(format!("index {at} is {}, expected less than {vertices}", indices[at]));
    }
    let (triangles, rest) = indices.as_chunks::<3>();
    if rest.is_empty() {
        Ok(triangles.to_vec())
    } else {
        Err(format!("{} indices, expected three a triangle", indices.len()))
    }
}

/// The bytes of a view, once they are known to lie in its buffer.
pub fn view_bytes<'a>(view: &gltf::buffer::View<'_>, buffer: &'a [u8]) -> Result<&'a [u8], String> {
    let outside = || format!("buffer view {} reaches outside its buffer", view.index());
    let start = view.offset();
    start.checked_add(view.length()).and_then(|end| buffer.get(start..end)).ok_or_else(outside)
}

/// Little-endian, of four bytes or fewer.
fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// The accessor's entries of `size` bytes, once they are known to lie in the file.
fn entries<'a>(
    accessor: &gltf::Accessor<'_>,
    buffer: &'a [u8],
    size: usize,
) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, String> {
    let outside = || format!("accessor {} reaches outside its buffer", accessor.index());
    let view = accessor.view().filter(|_| accessor.sparse().is_none()).ok_or("sparse accessors are not read")?;
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
    use super::parse;

    /// Found by fuzzing.
    #[test]
    fn a_binary_file_shorter_than_its_header_is_refused() {
        for said in [0_u32, 11, 12, u32::MAX] {
            let bytes = [&b"glTF"[..], &2_u32.to_le_bytes(), &said.to_le_bytes(), &[0; 8]].concat();
            let found = parse(&bytes).unwrap_err();
            assert_eq!(found.contains("as it says itself"), said < 12, "{found}");
        }
    }
}
