//! Writes a text file, with the path in the error.

use std::path::Path;

use crate::error::SampleError;

/// Writes `text` to `path`, replacing a file of that name.
pub(crate) fn write_text(path: &Path, text: &str) -> Result<(), SampleError> {
    std::fs::write(path, text).map_err(SampleError::io("write", path))
}
