//! Writes a file and the folders above it.

use std::path::Path;

use mateval_image::store::write_whole;

use crate::error::ExportError;

/// Writes `bytes` to `path`.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    make_folder_of(path)?;
    Ok(write_whole(path, bytes)?)
}

/// Copies a file.
pub(crate) fn copy_file(from: &Path, to: &Path) -> Result<(), ExportError> {
    make_folder_of(to)?;
    std::fs::copy(from, to).map_err(ExportError::io("copy", from))?;
    Ok(())
}

/// Makes the folder that `path` lies in.
pub(crate) fn make_folder_of(path: &Path) -> Result<(), ExportError> {
    let folder = path.parent().expect("an export writes below its own folder");
    std::fs::create_dir_all(folder).map_err(ExportError::io("make", folder))
}
