//! The built-in sample as a small dataset, which is built once and shared; tests that change it use a copy.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use super::command::{build, render, run, run_words};
pub use mateval_testkit::files_below;
use mateval_testkit::{copy_folder, kept_folder};

/// 96x72 pixels and atlases of 128 texels: all five views are built and rendered within seconds.
pub const SMALL: &str = "resolution = [96, 72]\natlas_size = 128";

static DATASET: LazyLock<PathBuf> = LazyLock::new(|| {
    let dataset = built("sample", SMALL);
    run(&mut render(&dataset, 1)).ends_with(0);
    dataset
});

static UNRENDERED: LazyLock<PathBuf> = LazyLock::new(|| built("unrendered", SMALL));

static OWN_MATERIALS: LazyLock<PathBuf> = LazyLock::new(|| {
    let dataset = built("own_materials", &format!("materials = \"source\"\n{SMALL}"));
    run(&mut render(&dataset, 1)).ends_with(0);
    dataset
});

/// The source that `mateval sample` writes.
static SOURCE: LazyLock<PathBuf> = LazyLock::new(|| {
    let source = kept_folder("source").join("source");
    run_words([Path::new("sample"), &source]).ends_with(0);
    source
});

fn built(name: &str, head: &str) -> PathBuf {
    let folder = kept_folder(name);
    let recipe = write_source(&folder.join("source"), head, &["room"]);
    let dataset = folder.join("dataset");
    run(&mut build(&recipe, &dataset)).ends_with(0);
    dataset
}

/// The shared dataset, rendered with one sample; tests must not write to it.
pub fn dataset() -> &'static Path {
    &DATASET
}

/// Like [`dataset`], but without renders: scoring on it takes a second, because nothing is rendered.
pub fn unrendered() -> &'static Path {
    &UNRENDERED
}

/// Like [`dataset`], but with the source's own materials.
pub fn own_materials() -> &'static Path {
    &OWN_MATERIALS
}

/// A copy of the shared dataset that a test may change.
pub fn copied_dataset() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_folder(dataset(), folder.path());
    folder
}

/// Writes the sample's source with a recipe that has these lines in its head and the room once for each id. Returns the
/// recipe's path.
pub fn write_source(source: &Path, head: &str, ids: &[&str]) -> PathBuf {
    copy_source(source);
    let recipe = source.join("recipe.toml");
    std::fs::write(&recipe, recipe_text(head, ids)).unwrap();
    recipe
}

/// Writes the sample's source with its own recipe: a copy, since packing its textures takes a second.
pub fn copy_source(source: &Path) {
    copy_folder(&SOURCE, source);
}

/// A recipe of the sample's room.
pub fn recipe_text(head: &str, ids: &[&str]) -> String {
    let scene = |id: &&str| format!("\n[[scene]]\nid = \"{id}\"\nbitterli = \"room/scene.xml\"\nhouse = \"sample\"\n");
    format!("name = \"sample\"\n{head}\n{}", ids.iter().map(scene).collect::<String>())
}

/// MANIFEST.sha256 as text.
pub fn manifest(dataset: &Path) -> String {
    std::fs::read_to_string(dataset.join("MANIFEST.sha256")).unwrap()
}

/// The content of a JSON file.
pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}
