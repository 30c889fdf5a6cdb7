//! Shared by the targets: writes bytes as a file in a new folder, for parsers that read files.

use std::path::{Path, PathBuf};

/// Writes the bytes as `name` into a new folder and calls a function with the file's path.
pub fn with_file<T>(name: &str, bytes: &[u8], read: impl FnOnce(&Path) -> T) -> T {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path: PathBuf = folder.path().join(name);
    std::fs::write(&path, bytes).expect("there is room for a small file");
    read(&path)
}
