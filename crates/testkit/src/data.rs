//! Inputs that are not in the repository: the shared data and the weights of LPIPS.
//!
//! If one of them is missing, the test that needs it is skipped, which is printed to stderr. With
//! `MATEVAL_REQUIRE_DATA=1`, which CI sets, the test fails instead.

use std::path::{Path, PathBuf};

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
