//! Faults of names and of `submission.json`.

use std::path::{Path, PathBuf};

use super::{ERROR, Fault, NOTE, WARNING, map};

fn json(submission: &Path) -> PathBuf {
    submission.join("submission.json")
}

/// Replaces a piece of `submission.json`.
fn edit(submission: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(json(submission)).unwrap();
    assert!(text.contains(from), "{text}");
    std::fs::write(json(submission), text.replacen(from, to, 1)).unwrap();
}

/// Changes the value of a key.
fn set(submission: &Path, key: &str, value: serde_json::Value) {
    let mut object: serde_json::Value = serde_json::from_slice(&std::fs::read(json(submission)).unwrap()).unwrap();
    object[key] = value;
    std::fs::write(json(submission), object.to_string()).unwrap();
}

fn rename(submission: &Path, from: &str, to: &str) {
    std::fs::rename(submission.join(from), submission.join(to)).unwrap();
}

fn link(submission: &Path, place: &str, to: &Path) {
    let place = submission.join(place);
    if place.is_dir() {
        std::fs::remove_dir_all(&place).unwrap();
    } else {
        let _ = std::fs::remove_file(&place);
    }
    std::os::unix::fs::symlink(to, place).unwrap();
}

pub const FAULTS: &[Fault] = &[
    ("no_submission_file", ERROR, |root| std::fs::remove_file(json(root)).unwrap()),
    ("bad_json", ERROR, |root| {
        let text = std::fs::read_to_string(json(root)).unwrap();
        std::fs::write(json(root), &text[..text.len() / 2]).unwrap();
    }),
    ("bad_json", ERROR, |root| edit(root, "\"method\"", "\"method\": \"twice\", \"method\"")),
    ("wrong_type", ERROR, |root| set(root, "method", 3.into())),
    ("missing_key", ERROR, |root| edit(root, "\"method\": \"gt\",", "")),
    ("unknown_key", ERROR, |root| set(root, "autor", "me".into())),
    ("wrong_format", ERROR, |root| set(root, "format", "mateval-submission/9".into())),
    ("json_too_large", ERROR, |root| set(root, "description", "x".repeat(2 << 20).into())),
    ("other_dataset", WARNING, |root| set(root, "dataset_manifest_sha256", "0".repeat(64).into())),
    ("bad_hash", WARNING, |root| set(root, "dataset_manifest_sha256", "latest".into())),
    ("no_method_name", WARNING, |root| set(root, "method", " ".into())),
    ("bad_method_name", WARNING, |root| set(root, "method", "a\nb".into())),
    ("no_scenes_folder", ERROR, |root| rename(root, "scenes", "results")),
    ("nested_submission", ERROR, |root| {
        let inner = root.with_file_name("inner");
        std::fs::rename(root, &inner).unwrap();
        std::fs::create_dir(root).unwrap();
        std::fs::rename(inner, root.join("mine")).unwrap();
    }),
    ("missing_scene", ERROR, |root| std::fs::remove_dir_all(root.join("scenes/living")).unwrap()),
    ("misnamed_scene", ERROR, |root| rename(root, "scenes/living", "scenes/Living_")),
    ("extra_scene", WARNING, |root| std::fs::create_dir(root.join("scenes/kitchen")).unwrap()),
    ("missing_object", ERROR, |root| std::fs::remove_dir_all(root.join("scenes/room/rug")).unwrap()),
    ("misnamed_object", ERROR, |root| rename(root, "scenes/room/wall_paper", "scenes/room/wallpaper")),
    ("extra_object", WARNING, |root| std::fs::create_dir(root.join("scenes/room/elephant")).unwrap()),
    ("not_a_folder", ERROR, |root| {
        std::fs::remove_dir_all(root.join("scenes/room/rug")).unwrap();
        std::fs::write(root.join("scenes/room/rug"), "").unwrap();
    }),
    ("missing_map", ERROR, |root| std::fs::remove_file(map(root, "base_color.png")).unwrap()),
    ("misnamed_map", ERROR, |root| rename(root, "scenes/room/rug/base_color.png", "scenes/room/rug/albedo.png")),
    ("wrong_ending", ERROR, |root| {
        rename(root, "scenes/room/rug/base_color.png", "scenes/room/rug/base_color.jpg");
    }),
    ("ambiguous_map", ERROR, |root| std::fs::write(map(root, "base_color.exr"), "").unwrap()),
    ("not_a_file", ERROR, |root| {
        std::fs::remove_file(map(root, "base_color.png")).unwrap();
        std::fs::create_dir(map(root, "base_color.png")).unwrap();
    }),
    ("default_roughness", NOTE, |root| std::fs::remove_file(map(root, "roughness.png")).unwrap()),
    ("default_metallic", NOTE, |root| std::fs::remove_file(map(root, "metallic.png")).unwrap()),
    ("extra_file", NOTE, |root| std::fs::write(root.join("README.md"), "mine").unwrap()),
    ("link_leads_out", ERROR, |root| {
        let outside = root.with_file_name("outside.png");
        std::fs::copy(map(root, "base_color.png"), &outside).unwrap();
        link(root, "scenes/room/rug/base_color.png", &outside);
    }),
    ("broken_link", ERROR, |root| link(root, "scenes/room/rug/base_color.png", Path::new("nowhere.png"))),
    ("useless_link", WARNING, |root| link(root, "notes", Path::new("/etc"))),
    ("bad_name", ERROR, |root| {
        use std::os::unix::ffi::OsStrExt as _;
        std::fs::write(root.join(std::ffi::OsStr::from_bytes(b"\xff.png")), "").unwrap();
    }),
];
