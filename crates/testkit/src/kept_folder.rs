//! Folders for what several tests of one run share.

use std::path::{Path, PathBuf};

/// Makes a new folder that outlives the tests of this run, since nothing drops a static. It lies in the build's folder
/// for temporary files, from which folders older than an hour are removed.
pub fn kept_folder(name: &str) -> PathBuf {
    const OLD: std::time::Duration = std::time::Duration::from_secs(3600);
    let root = build_folder().join("tmp");
    std::fs::create_dir_all(&root).unwrap();
    for entry in std::fs::read_dir(&root).into_iter().flatten().flatten() {
        let modified = entry.metadata().and_then(|metadata| metadata.modified());
        if modified.is_ok_and(|time| time.elapsed().is_ok_and(|age| age > OLD)) {
            // Another run may be removing it too.
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
    tempfile::Builder::new().prefix(&format!("{name}-")).tempdir_in(root).unwrap().keep()
}

/// Copies all files below `from`.
pub fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let place = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy_folder(&entry.path(), &place);
        } else {
            std::fs::copy(entry.path(), place).unwrap();
        }
    }
}

/// `target`, of which the running test is `target/<profile>/deps/<name>`.
fn build_folder() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.ancestors().nth(3).expect("a test's program lies three folders deep").to_owned()
}
