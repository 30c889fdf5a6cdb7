//! Code that the tests and benches of several crates share. It is only a dev-dependency: no released crate uses it.
//!
//! [`scenes`] builds small scenes, [`bench_scene`] reads larger ones, and [`statistics`] compares their noisy renders;
//! `sample_dataset` is the built-in sample as a dataset, with submissions for it, and [`faulty_house`] its house with
//! a third room and faults; [`packed`] writes archives byte by byte. This file finds inputs that are not in the
//! repository, makes folders that tests share and writes NumPy arrays.
//!
//! If one of these inputs is missing, the test that needs it is skipped, which is printed to stderr. With
//! `MATEVAL_REQUIRE_DATA=1`, which CI sets, the test fails instead.

#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "a test that cannot be set up has failed")]

pub mod bench_scene;
pub mod faulty_house;
pub mod packed;
#[cfg(feature = "sample_dataset")]
pub mod sample_dataset;
pub mod scenes;
pub mod statistics;

use std::path::{Path, PathBuf};

use mateval_dataset::layout::BuildFolder;
use npyz::WriterBuilder as _;

/// The path of `file` in the shared data: in the folder that `MATEVAL_DATA` names, or in `../shared/data` from the
/// repository's root. If it does not exist, reports this and returns none, or panics under
/// `MATEVAL_REQUIRE_DATA=1`.
pub fn shared_data(file: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let path = variable("MATEVAL_DATA").unwrap_or_else(beside).join(file);
    existing(path, "set MATEVAL_DATA to the folder of the shared data")
}

/// The path of a weights file of LPIPS in MatEval's cache folder. If it does not exist, reports this and returns none,
/// or panics under `MATEVAL_REQUIRE_DATA=1`.
pub fn lpips_weights(file: &str) -> Option<PathBuf> {
    let folder = variable("MATEVAL_CACHE")
        .or_else(|| variable("XDG_CACHE_HOME").map(|folder| folder.join("mateval")))
        .or_else(|| variable("HOME").map(|folder| folder.join(".cache/mateval")))
        .unwrap_or_default();
    existing(folder.join(file), "run: mateval fetch lpips")
}

/// Reports that an input of a test is missing: as skipped, or with a panic under `MATEVAL_REQUIRE_DATA=1`.
pub fn report_missing(what: &str) {
    assert!(!is_required(), "MATEVAL_REQUIRE_DATA is set: {what}");
    say_skipped(what);
}

/// Prints to stderr, bypassing the test runner's capture, that a test or a part of it is skipped.
pub fn say_skipped(why: &str) {
    use std::io::Write as _;
    let thread = std::thread::current();
    let line = format!("SKIPPED: {}: {why}\n", thread.name().unwrap_or("a test"));
    // A closed stderr must not fail the test.
    let _ = std::io::stderr().write_all(line.as_bytes());
}

fn existing(path: PathBuf, hint: &str) -> Option<PathBuf> {
    if path.exists() {
        return Some(path);
    }
    report_missing(&format!("no '{}'; {hint}", path.display()));
    None
}

fn is_required() -> bool {
    std::env::var_os("MATEVAL_REQUIRE_DATA").is_some_and(|value| value == "1")
}

/// An environment variable that is set and not empty.
fn variable(name: &str) -> Option<PathBuf> {
    std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from)
}

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

/// Makes the recipe of a build ask for these twins of every scene, in place of those that it asked for.
pub fn want_twins(root: &Path, lightings: &str) {
    let path = BuildFolder::of(root).recipe();
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<String> = text
        .lines()
        .filter(|line| !line.starts_with("twins = "))
        .map(|line| line.replace("[[scene]]", &format!("[[scene]]\ntwins = [{lightings}]")))
        .collect();
    std::fs::write(&path, lines.join("\n")).unwrap();
}

/// The bytes of a NumPy array.
pub fn npy<T: npyz::AutoSerialize + Copy>(numbers: &[T], shape: &[u64]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut bytes).begin_nd().unwrap();
    writer.extend(numbers.iter().copied()).unwrap();
    writer.finish().unwrap();
    bytes
}

/// Every file below `root`, relative, sorted.
pub fn files_below(root: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.push(path.strip_prefix(root).unwrap().to_owned());
            }
        }
    }
    files.sort();
    files
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
