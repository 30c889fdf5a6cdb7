//! The contents of the accessors of an untrusted glTF: nothing is read outside a buffer. Accessors may be sparse, without
//! a buffer view (all zeros), or quantized (`KHR_mesh_quantization`).

use gltf::accessor::DataType;
use gltf::accessor::sparse::IndexType;

use crate::gltf_error::GltfError;

/// The most bytes of one accessor's contents. One without a buffer view takes none in the file.
const MOST_BYTES: usize = 1 << 31;

/// The entries of an accessor of `N` numbers each, which may be NaN. Normalized integers stand for 0 to 1, or for -1 to 1
/// (glTF 2.0, section 3.6.2.2), other integers for themselves.
pub fn numbers<const N: usize>(
    accessor: &gltf::Accessor<'_>,
    buffers: &[impl AsRef<[u8]>],
) -> Result<Vec<[f32; N]>, GltfError> {
    let found = accessor.dimensions().multiplicity();
    if found != N {
        return Err(GltfError::OtherNumbers { accessor: accessor.index(), expected: N, found });
    }
    first_numbers(accessor, buffers)
}

/// As [`numbers`], of accessors that may have more than `N` numbers per entry; the first `N` count.
pub fn first_numbers<const N: usize>(
    accessor: &gltf::Accessor<'_>,
    buffers: &[impl AsRef<[u8]>],
) -> Result<Vec<[f32; N]>, GltfError> {
    let found = accessor.dimensions().multiplicity();
    if found < N {
        return Err(GltfError::OtherNumbers { accessor: accessor.index(), expected: N, found });
    }
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
        found => return Err(GltfError::NotIndices { accessor: accessor.index(), found }),
    };
    if accessor.dimensions().multiplicity() != 1 {
        return Err(GltfError::NotOneIndex { accessor: accessor.index() });
    }
    Ok(entries(accessor, buffers, size)?.chunks_exact(size).map(word).collect())
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
pub fn view_bytes<'a>(view: &gltf::buffer::View<'_>, buffers: &'a [impl AsRef<[u8]>]) -> Result<&'a [u8], GltfError> {
    let outside = || GltfError::ViewOutside { view: view.index() };
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
    let too_large = || GltfError::AccessorTooLarge { accessor: index, most: MOST_BYTES };
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
            target.ok_or(GltfError::AccessorOutside { accessor: index })?.copy_from_slice(value);
        }
    }
    Ok(all)
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
    let outside = || GltfError::AccessorOutside { accessor };
    let slice = view_bytes(view, buffers).map_err(|_| outside())?;
    let stride = view.stride().unwrap_or(size).max(size);
    let used = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size));
    let end = used.and_then(|used| used.checked_add(offset)).filter(|end| *end <= slice.len());
    let data = slice.get(offset..end.ok_or_else(outside)?).ok_or_else(outside)?;
    Ok((0..count).flat_map(|at| &data[at * stride..at * stride + size]).copied().collect())
}
