//! `prep export --as mitsuba`: a view of the sample for Mitsuba 3.

use std::path::Path;

use super::command::{Run, mateval, run};
use super::sample::{copied_dataset, dataset, files_below, own_materials};

fn export(dataset: &Path, scene: &str, view: &str, out: &Path, more: &[&str]) -> Run {
    let words = ["--scene", scene, "--view", view, "--samples", "4"];
    run(mateval().args(["prep", "export", "--as", "mitsuba"]).arg(dataset).args(words).arg("--out").arg(out).args(more))
}

/// Converted materials are Blender's, which Mitsuba does not have.
#[test]
fn converted_materials_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let done = export(dataset(), "room", "input", &folder.path().join("out"), &[]).ends_with(1);
    done.says("blender_principled");
}

/// With the source's own materials.
#[test]
fn the_sample_is_represented_completely() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let dataset = own_materials();
    let done = export(dataset, "room", "up_left", &out, &[]).ends_with(0);
    let expected = format!("{}: means the same in Mitsuba, 0 differences\n", out.join("scene.xml").display());
    assert_eq!(done.stdout, expected);
    let files = files_below(&out);
    let text = std::fs::read_to_string(out.join("scene.xml")).unwrap();
    assert!(
        files.len() > 20
            && files.iter().all(|file| text.contains(&file.display().to_string()) || file.ends_with("scene.xml"))
    );
    assert!(text.contains("<integer name=\"sample_count\" value=\"4\"/>"));

    // A second export is refused; a forced one writes the same bytes.
    export(dataset, "room", "up_left", &out, &[]).ends_with(2).says("already exists");
    export(dataset, "room", "up_left", &out, &["--force"]).ends_with(0);
    assert_eq!(std::fs::read_to_string(out.join("scene.xml")).unwrap(), text);
    // Another view has another camera.
    export(dataset, "room", "input", &out, &["--force"]).ends_with(0);
    assert_ne!(std::fs::read_to_string(out.join("scene.xml")).unwrap(), text);
}

#[test]
fn missing_inputs_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    export(dataset(), "attic", "input", &out, &[]).ends_with(2).says("has no scene 'attic'");
    export(dataset(), "room", "behind", &out, &[]).ends_with(2).says("has no view 'behind' of the scene 'room'");
    let withheld = copied_dataset();
    std::fs::remove_dir_all(withheld.path().join("scenes/room/ground_truth")).unwrap();
    let shown = export(withheld.path(), "room", "input", &out, &[]).ends_with(2);
    assert!(shown.error().contains("ground_truth"), "{}", shown.stderr);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// Ground truth that was changed after the dataset was built is not exported.
#[test]
fn changed_truth_is_refused() {
    let changed = copied_dataset();
    let lights = changed.path().join("scenes/room/ground_truth/lights.json");
    let text = std::fs::read_to_string(&lights).unwrap();
    std::fs::write(&lights, text.replacen("\"camera_visible\": true", "\"camera_visible\": false", 1)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    export(changed.path(), "room", "input", &folder.path().join("out"), &[]).ends_with(2).says("lights.json");
}

#[test]
fn one_scene_is_named() {
    let export =
        |words: &[&str]| run(mateval().args(["prep", "export", "nowhere", "--out", "out", "--as"]).args(words));
    export(&["mitsuba"]).ends_with(2).says("--scene");
    export(&["tar", "--scene", "room"]).ends_with(2).says("--scene is for --as mitsuba");
    export(&["tar", "--force"]).ends_with(2).says("--scene");
}
