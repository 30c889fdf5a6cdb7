//! The buffers of a glTF, read as a whole.

use mateval_scene::gltf_file::GltfFile;
use mateval_scene::source_folder::SourceFolder;

use super::error::GltfSceneError;
use super::limits::Limits;
use super::uri;

/// Reads all buffers. The binary part of a .glb is moved out of `file`.
pub(super) fn read(
    file: &mut GltfFile,
    folder: &mut SourceFolder,
    limits: &Limits,
) -> Result<Vec<Vec<u8>>, GltfSceneError> {
    let mut blob = file.blob.take();
    let mut buffers = Vec::new();
    let mut total = 0_u64;
    for buffer in file.document.buffers() {
        let number = buffer.index();
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => blob.take().ok_or(GltfSceneError::BufferWithoutData { buffer: number })?,
            gltf::buffer::Source::Uri(uri) => {
                uri::read(uri, folder).map_err(|reason| GltfSceneError::Buffer { buffer: number, reason })?.0
            }
        };
        total = total.saturating_add(bytes.len() as u64);
        if total > limits.file_bytes {
            return Err(GltfSceneError::BuffersTooLarge { most: limits.file_bytes });
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}
