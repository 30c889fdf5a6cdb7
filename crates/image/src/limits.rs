//! The limits on the size of an untrusted picture, which are checked before memory is taken for it, and the error of
//! this crate.

use std::path::{Path, PathBuf};

use mateval_files::FileError;
use mateval_files::untrusted::read_at_most;

/// Why a picture could not be read, written or made.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    #[error(transparent)]
    Files(#[from] FileError),
    /// The file is damaged, of another kind than expected, or beyond a limit.
    #[error("'{}': {what}", path.display())]
    Invalid {
        path: PathBuf,
        /// What was expected and what was found.
        what: String,
    },
    /// The file is valid, but of a kind that is not read here.
    #[error("'{}': unsupported: {what}", path.display())]
    Unsupported {
        path: PathBuf,
        /// What was found and what is supported.
        what: String,
    },
    /// The number of pixels is not width times height.
    #[error("a picture of {width}x{height} needs {expected} pixels, {found} were given")]
    PixelCount { width: usize, height: usize, expected: usize, found: usize },
}

impl ImageError {
    pub(crate) fn invalid(path: &Path, what: impl Into<String>) -> Self {
        Self::Invalid { path: path.to_owned(), what: what.into() }
    }

    pub(crate) fn unsupported(path: &Path, what: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_owned(), what: what.into() }
    }
}

/// What was expected of a file's bytes and what was found, for callers who name the file.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Malformed(pub(crate) String);

/// Most pixels in a row and most rows.
const MAX_SIDE: u64 = 16_384;
/// Most pixels in a picture: 8192 x 8192.
pub const MAX_PIXELS: u64 = 1 << 26;
/// Largest file, in bytes.
pub const MAX_FILE_BYTES: u64 = 1 << 30;

/// Fails where a picture of this size is beyond the limits.
pub fn check_size(path: &Path, width: u64, height: u64) -> Result<(), ImageError> {
    let sound = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) && width * height <= MAX_PIXELS;
    if sound {
        return Ok(());
    }
    let expected = format!("expected 1 to {MAX_SIDE} a side and at most {MAX_PIXELS} together");
    Err(ImageError::invalid(path, format!("a picture of {width}x{height} pixels; {expected}")))
}

/// The file's bytes; fails where there are more than [`MAX_FILE_BYTES`].
pub fn read_file(path: &Path) -> Result<Vec<u8>, ImageError> {
    Ok(read_at_most(path, MAX_FILE_BYTES).map_err(FileError::io("read", path))?)
}
