//! Writes a file whole or not at all: beside its place first, then renamed.

use std::io::Write as _;
use std::path::Path;

use crate::{ImageError, temporary};

/// Writes `bytes` to `path`, replacing an existing file. `path` never holds a half-written file, and of several
/// processes that write it at once the last one's bytes stay, whole.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let refused = |source| ImageError::Io { action: "write", path: path.to_owned(), source };
    let Some(partial) = temporary::beside(path) else {
        return Err(refused(std::io::ErrorKind::InvalidFilename.into()));
    };
    let written = std::fs::File::create(&partial)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_data()))
        .and_then(|()| std::fs::rename(&partial, path));
    written.map_err(|source| {
        // The disk may be full, so the partial file is removed; if that fails too, the first error is reported.
        let _ = std::fs::remove_file(&partial);
        refused(source)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_whole_and_leaves_nothing_beside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_whole(&path, b"old and long").unwrap();
        write_whole(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_refusal_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let error = write_whole(&folder.path().join("missing/a.txt"), b"x").unwrap_err();
        assert!(error.to_string().contains("a.txt"), "{error}");
    }
}
