//! The limits on pictures and files, which are checked before memory is taken.

use std::io::{Error, ErrorKind, Read as _};
use std::path::Path;

use crate::ImageError;

/// Most pixels in a row and most rows.
pub const MAX_SIDE: u64 = 16_384;
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
    Err(ImageError::Invalid {
        path: path.to_owned(),
        what: format!(
            "a picture of {width}x{height} pixels; expected 1 to {MAX_SIDE} a side and at most {MAX_PIXELS} together"
        ),
    })
}

/// The file's bytes; fails where there are more than [`MAX_FILE_BYTES`].
pub fn read_file(path: &Path) -> Result<Vec<u8>, ImageError> {
    read_at_most(path, MAX_FILE_BYTES).map_err(|source| ImageError::Io {
        action: "read",
        path: path.to_owned(),
        source,
    })
}

/// The bytes of an ordinary file; fails where there are more than `most`. Anything else, such as `/dev/zero` or a pipe,
/// is not opened, since its length is unknown and may be endless.
pub fn read_at_most(path: &Path, most: u64) -> std::io::Result<Vec<u8>> {
    let data = std::fs::metadata(path)?;
    if data.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "it is a folder, expected a file"));
    }
    if !data.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "it is not an ordinary file"));
    }
    let mut bytes = Vec::new();
    // The file may grow while it is read.
    if data.len() <= most {
        std::fs::File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    }
    if data.len().max(bytes.len() as u64) > most {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("it has more than {most} bytes")));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_is_read_than_is_wanted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "abc").unwrap();
        assert_eq!(read_at_most(&path, 3).unwrap(), b"abc");
        assert_eq!(read_at_most(&path, 2).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read_at_most(folder.path(), 3).unwrap_err().kind(), ErrorKind::IsADirectory);
        assert_eq!(read_at_most(&folder.path().join("none"), 3).unwrap_err().kind(), ErrorKind::NotFound);
    }

    /// The system reports their length as 0.
    #[cfg(unix)]
    #[test]
    fn what_has_no_end_is_not_begun() {
        assert!(read_at_most(Path::new("/dev/zero"), 3).unwrap_err().to_string().contains("not an ordinary file"));
    }
}
