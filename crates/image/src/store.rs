//! Files that are there whole or not at all: written beside their place, then renamed.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::ImageError;

/// Writes `bytes` to `path`, replacing what is there. Nothing half-written is ever at `path`; what a killed process left
/// beside it (`NAME.partial`) is overwritten the next time.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let partial = partial_path(path);
    let written = std::fs::File::create(&partial)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_data()))
        .and_then(|()| std::fs::rename(&partial, path));
    written.map_err(|source| {
        // The disk may be full: leave no remains. A failure to remove changes nothing about the error.
        let _ = std::fs::remove_file(&partial);
        ImageError::Io { action: "write", path: path.to_owned(), source }
    })
}

fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".partial");
    path.with_file_name(name)
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
