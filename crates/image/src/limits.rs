//! What the largest picture is that is read; checked on the header, before memory is taken.

use std::path::Path;

use crate::ImageError;

/// Most pixels in a row and most rows.
pub const MAX_SIDE: u64 = 16_384;
/// Most pixels in a picture: 8192 x 8192.
pub const MAX_PIXELS: u64 = 1 << 26;
/// Largest file, in bytes.
pub const MAX_FILE_BYTES: u64 = 1 << 30;

/// Fails where a picture of this size would not be read.
pub fn check_size(path: &Path, width: u64, height: u64) -> Result<(), ImageError> {
    let sound = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) && width * height <= MAX_PIXELS;
    if sound {
        return Ok(());
    }
    Err(ImageError::Invalid {
        path: path.to_owned(),
        what: format!(
            "a picture of {width}x{height} pixels; expected 1 to {MAX_SIDE} a side and at most {MAX_PIXELS} in all"
        ),
    })
}

/// The file's bytes; fails where there are more than [`MAX_FILE_BYTES`].
pub fn read_file(path: &Path) -> Result<Vec<u8>, ImageError> {
    let io = |source| ImageError::Io { action: "read", path: path.to_owned(), source };
    let length = std::fs::metadata(path).map_err(io)?.len();
    if length > MAX_FILE_BYTES {
        let what = format!("{length} bytes; expected at most {MAX_FILE_BYTES}");
        return Err(ImageError::Invalid { path: path.to_owned(), what });
    }
    std::fs::read(path).map_err(io)
}
