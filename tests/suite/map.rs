//! Checks `crates/README.md`, the map of the code, against the code: the paths, and the first lines.

use std::path::{Path, PathBuf};

use super::sample::files_below;

fn crates() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("crates")
}

/// The paths that a text names: words in backticks with a slash and without blanks.
fn named_paths(text: &str) -> Vec<&str> {
    let words = text.split('`').skip(1).step_by(2);
    words.filter(|word| word.contains('/') && !word.contains([' ', '<', '*'])).collect()
}

/// The paths that exist neither below `crates/` nor below the repository's root.
fn missing(paths: &[&str]) -> Vec<String> {
    let exists = |path: &&&str| [crates(), crates().join("..")].iter().any(|root| root.join(path).exists());
    paths.iter().filter(|path| !exists(path)).map(|path| (*path).to_owned()).collect()
}

#[test]
fn every_path_on_the_map_exists() {
    let map = std::fs::read_to_string(crates().join("README.md")).unwrap();
    let paths = named_paths(&map);
    assert!(paths.len() > 40, "only {} paths on the map", paths.len());
    assert_eq!(missing(&paths), [""; 0], "crates/README.md names files that do not exist");
}

/// The twin.
#[test]
fn a_missing_path_is_found() {
    let text = "| a metric | `metrics/src/`, `metrics/src/nowhere.rs`, `cargo run -- demo` |";
    assert_eq!(missing(&named_paths(text)), ["metrics/src/nowhere.rs"]);
}

/// Whether a file begins with a line that states its content.
fn introduces_itself(text: &str) -> bool {
    text.lines().next().is_some_and(|line| line.strip_prefix("//! ").is_some_and(|words| words.len() > 10))
}

#[test]
fn every_source_file_states_its_content() {
    let files = files_below(&crates());
    let sources = files.iter().filter(|path| path.extension().is_some_and(|extension| extension == "rs"));
    let mut seen = 0;
    let mut silent = Vec::new();
    for path in sources.filter(|path| path.components().any(|part| part.as_os_str() == "src")) {
        seen += 1;
        if !introduces_itself(&std::fs::read_to_string(crates().join(path)).unwrap()) {
            silent.push(path);
        }
    }
    assert!(seen > 250, "only {seen} files seen");
    assert!(silent.is_empty(), "begin these files with a line that states their content: {silent:?}");
    assert!(!introduces_itself("use std::path::Path;") && !introduces_itself("//! Tests.\n"));
}
