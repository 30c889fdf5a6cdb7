//! Tests on the real scenes, if these exist: a small dataset of one, and the missing files of another.

use std::path::Path;

use mateval_dataset::Severity;
use mateval_sources::bitterli;
use mateval_testkit::shared_data;

use super::command::{baseline, build, run, score_under, verify};
use super::sample::json;

/// Builds staircase2 with these lines in the recipe's head; returns the summary of `gt`'s scores.
fn staircase(source: &Path, folder: &Path, lines: &str) -> serde_json::Value {
    let recipe = folder.join("recipe.toml");
    let scene = "[[scene]]\nid = \"staircase2\"\nbitterli = \"staircase2/scene.xml\"\n";
    std::fs::write(&recipe, format!("name = \"real\"\nresolution = [96, 54]\n{lines}\n{scene}")).unwrap();
    let [dataset, submission, result] = ["dataset", "gt", "RESULT.json"].map(|name| folder.join(name));
    run(build(&recipe, &dataset).arg("--source").arg(source)).ends_with(0);
    run(&mut baseline("gt", &dataset, &submission)).ends_with(0);
    let mut command = score_under(&["mateval-3"], &submission, &dataset, &result);
    run(command.env("MATEVAL_CACHE", folder)).ends_with(0);
    json(&result)["protocols"]["mateval-3"]["summary"].clone()
}

/// 30,911 triangles in OBJ files; rectangles and disks are additional. With the atlases that the tool chooses the truth
/// scores far above 38 dB. The twin: with atlases that are too small, it stays below.
#[test]
fn staircase2_is_built_verified_and_scored() {
    let Some(scene_file) = shared_data("bitterli/staircase2/scene.xml") else { return };
    let source = scene_file.parent().unwrap().parent().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let summary = staircase(source, folder.path(), "");
    run(&mut verify(&folder.path().join("dataset"))).ends_with(0);
    let scene = json(&folder.path().join("dataset/scenes/staircase2/scene.json"));
    let of_files = |instance: &&serde_json::Value| instance["name"].as_str().unwrap().starts_with("Mesh");
    let instances = scene["instances"].as_array().unwrap();
    let triangles: u64 = instances.iter().filter(of_files).map(|i| i["triangles"].as_u64().unwrap()).sum();
    assert_eq!((triangles, instances.len()), (30_911, 32));
    let psnr = |summary: &serde_json::Value, key: &str| summary[format!("{key}.psnr")].as_f64().unwrap();
    assert!(psnr(&summary, "albedo.input") > 45.0, "{summary}");
    assert!((psnr(&summary, "albedo.input") - psnr(&summary, "albedo_aligned.input")).abs() < 0.1, "{summary}");
    // The input view is enough.
    let coarse = staircase(source, tempfile::tempdir().unwrap().path(), "atlas_size = 64\nviews = []");
    assert!(psnr(&coarse, "albedo.input") < 38.0, "{coarse}");
}

#[test]
fn bathroom_names_exactly_what_is_missing() {
    let Some(file) = shared_data("bitterli/bathroom/scene.xml") else { return };
    let read = bitterli::read(&file, None, &bitterli::Limits::default()).unwrap();
    let warnings = read.findings.iter().filter(|finding| finding.severity != Severity::Note);
    let missing: Vec<(&str, &str)> = warnings.map(|f| (f.code.as_str(), f.file.as_str())).collect();
    let expected = ["models/Mesh206.obj", "models/Mesh263.obj", "models/Mesh381.obj", "textures/rug.png"];
    assert_eq!(missing, expected.map(|file| ("missing_file", file)));
}

/// The twin: the other scenes lack nothing, in either spelling.
#[test]
fn the_other_scenes_are_whole() {
    for name in ["staircase2/scene.xml", "living-room/scene.xml", "living-room/scene_v0.6_dppm.xml"] {
        let Some(file) = shared_data(&format!("bitterli/{name}")) else { return };
        let read = bitterli::read(&file, None, &bitterli::Limits::default()).unwrap();
        let above_note = read.findings.iter().filter(|finding| finding.severity != Severity::Note);
        assert_eq!(above_note.count(), 0, "{name}");
    }
}
