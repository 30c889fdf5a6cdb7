//! Checks the documents against the program: the schemas, examples and worked numbers of `dataset_spec/`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::SceneFile;
use serde_json::Value;

use super::command::run_words;

/// The command that updates the schemas.
const FIX: &str = "cargo run -- schema dataset_spec/schema --force";

fn spec(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("dataset_spec").join(path)
}

/// Every file of a folder, by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap())).collect()
}

/// A line for every file whose bytes differ between the folders.
fn differences(made: &Path, kept: &Path) -> Vec<String> {
    let (made, kept) = (files(made), files(kept));
    let names: std::collections::BTreeSet<&String> = made.keys().chain(kept.keys()).collect();
    names.into_iter().filter(|name| made.get(*name) != kept.get(*name)).map(|n| format!("{n}; run: {FIX}")).collect()
}

fn write_schemas(folder: &Path) {
    run_words(["schema".as_ref(), folder.as_os_str()]).ends_with(0);
}

#[test]
fn schemas_are_those_of_the_types() {
    let made = tempfile::tempdir().unwrap();
    write_schemas(made.path());
    assert_eq!(files(made.path()).len(), 26);
    assert_eq!(differences(made.path(), &spec("schema")), Vec::<String>::new());
}

/// The twin: a changed, a missing and an additional file are each found.
#[test]
fn a_changed_schema_is_found() {
    let (made, kept) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    write_schemas(made.path());
    write_schemas(kept.path());
    let changed = kept.path().join("scene.schema.json");
    let text = std::fs::read_to_string(&changed).unwrap();
    std::fs::write(&changed, text.replace("world_from_camera", "camera_from_world")).unwrap();
    std::fs::remove_file(kept.path().join("lights.schema.json")).unwrap();
    std::fs::write(kept.path().join("old.schema.json"), "{}").unwrap();
    let expected = ["lights", "old", "scene"].map(|name| format!("{name}.schema.json; run: {FIX}"));
    assert_eq!(differences(made.path(), kept.path()), expected);
}

#[test]
fn nothing_is_overwritten_without_force() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.schema.json"), "mine").unwrap();
    run_words(["schema".as_ref(), folder.path().as_os_str()]).ends_with(2).says("add --force to overwrite it");
    assert_eq!(files(folder.path()).len(), 1);
    run_words(["schema".as_ref(), folder.path().as_os_str(), "--force".as_ref()]).ends_with(0);
    assert_eq!(files(folder.path()).len(), 26);
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The violations of the schema with the example's name.
fn breaches(name: &str, example: &Value) -> Vec<String> {
    let schema = json(&spec(&format!("schema/{name}.schema.json")));
    let validator = jsonschema::validator_for(&schema).unwrap();
    validator.iter_errors(example).map(|error| format!("{}: {error}", error.instance_path())).collect()
}

#[test]
fn examples_match_their_schemas() {
    let mut seen = 0;
    for name in files(&spec("examples")).keys().filter_map(|name| name.strip_suffix(".json")) {
        let example = json(&spec(&format!("examples/{name}.json")));
        assert_eq!(breaches(name, &example), Vec::<String>::new(), "{name}");
        // The twin: an unknown key, and a missing one.
        let mut unknown = example.clone();
        unknown.as_object_mut().unwrap().insert("colour".to_owned(), Value::Null);
        let mut lacking = example;
        lacking.as_object_mut().unwrap().remove("format");
        assert_eq!([breaches(name, &unknown).len(), breaches(name, &lacking).len()], [1, 1], "{name}");
        seen += 1;
    }
    assert_eq!(seen, 3);
}

#[test]
fn the_example_recipe_can_be_read() {
    let (recipe, text) = mateval_prep::recipe::read(&spec("examples/recipe.toml")).unwrap();
    assert_eq!((recipe.scenes.len(), recipe.views.len()), (2, 2));
    // The twin.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recipe.toml");
    std::fs::write(&path, text.replace("samples", "sample_count")).unwrap();
    assert!(mateval_prep::recipe::read(&path).is_err());
}

fn near(found: [f64; 3], expected: [f64; 3], slack: f64) -> bool {
    found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < slack)
}

/// FORMAT.md, section 4: pixel (60, 210) of the input view, its depth, its place in the world and in `up_left`.
#[test]
fn the_worked_example_of_the_camera_is_right() {
    let text = std::fs::read_to_string(spec("FORMAT.md")).unwrap();
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for numbers in ["2.7076979", "(1.129893, 0.012000, 2.234759)", "2.695910, pixel position (81.6560, 232.5347)"] {
        assert!(text.contains(numbers), "FORMAT.md no longer contains {numbers}");
    }
    let scene: SceneFile = mateval_dataset::json::read(&spec("examples/scene.json")).unwrap();
    let [input, up_left] = [&scene.views[0].camera, &scene.views[1].camera];
    assert!(input.turned(5.0, 5.0).matrix().abs_diff_eq(up_left.matrix(), 1e-12));
    let world = input.unproject([60.5, 210.5].into(), 2.7076979);
    assert!(near(world.to_array(), [1.129893, 0.012, 2.234759], 1e-6), "{world}");
    let (pixel, depth) = up_left.project(world).unwrap();
    assert!(near([pixel.x, pixel.y, depth], [81.6560, 232.5347, 2.695910], 1e-4), "{pixel} {depth}");
    // The twin: with the opposite turn the point lies elsewhere.
    let (other, _) = input.turned(-5.0, 5.0).project(world).unwrap();
    assert!((other - pixel).length() > 10.0);
}
