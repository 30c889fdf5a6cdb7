//! Folders for data that many tests share.

use std::path::{Path, PathBuf};

/// A folder that is kept after the tests of this run, because statics are never dropped. It lies in Cargo's folder for
/// temporary files of tests; folders of earlier runs are removed from there.
pub fn kept_folder(name: &str) -> PathBuf {
    const OLD: std::time::Duration = std::time::Duration::from_secs(3600);
    let root = Path::new(env!("CARGO_TARGET_TMPDIR"));
    for entry in std::fs::read_dir(root).into_iter().flatten().flatten() {
        let modified = entry.metadata().and_then(|metadata| metadata.modified());
        if modified.is_ok_and(|time| time.elapsed().is_ok_and(|age| age > OLD)) {
            // Another run may remove it at the same time.
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
    tempfile::Builder::new().prefix(&format!("{name}-")).tempdir_in(root).unwrap().keep()
}
