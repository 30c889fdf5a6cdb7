//! Reads glTF files that other tools wrote: trimesh and three.js's GLTFExporter. Blender's are read by
//! `tests/suite/gltf.rs`.
//!
//! `tools/test_gltf.sh` installs both, sets `MATEVAL_GLTF_PYTHON` to the Python interpreter that has trimesh and
//! `MATEVAL_GLTF_NODE_MODULES` to the folder that holds three.js, and runs these tests.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]
#![allow(clippy::print_stderr, reason = "findings are shown")]

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use mateval_sources::gltf::{Limits, read};
use mateval_sources::source_scene::FileScene;

fn set(name: &str) -> OsString {
    std::env::var_os(name).unwrap_or_else(|| panic!("{name} is not set: run tools/test_gltf.sh"))
}

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/writers").join(name)
}

/// Runs a command that writes `out`, and reads that file.
fn written(command: &mut Command, out: &Path) -> FileScene {
    let done = command.arg(out).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let scene = read(out, None, &Limits::default()).unwrap();
    for finding in &scene.findings {
        eprintln!("{}: {} {} {}", out.display(), finding.code, finding.place, finding.message);
    }
    scene
}

fn names(scene: &FileScene) -> BTreeSet<&str> {
    scene.scene.surfaces.iter().map(|surface| surface.name.as_str()).collect()
}

#[test]
fn trimesh() {
    let folder = tempfile::tempdir().unwrap();
    mateval_sample::write(folder.path()).unwrap();
    let models = std::fs::read_dir(folder.path().join("room/models")).unwrap().count();
    for name in ["room.glb", "room.gltf"] {
        let mut command = Command::new(set("MATEVAL_GLTF_PYTHON"));
        command.arg(script("trimesh_room.py")).arg(folder.path().join("room"));
        let scene = written(&mut command, &folder.path().join(name));
        assert_eq!(scene.scene.surfaces.len(), models + 1, "{name}");
        assert!(names(&scene).is_superset(&BTreeSet::from(["table", "mirrored", "floor"])), "{:?}", names(&scene));
        let area = |name: &str| scene.scene.surfaces.iter().find(|s| s.name == name).map(|s| s.mesh.area()).unwrap();
        assert!((area("table") / area("mirrored") - 1.0).abs() < 1e-5);
        assert!(scene.scene.textures.len() >= 1 && scene.camera.is_some());
    }
}

#[test]
fn three_js() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["room.glb", "room.gltf"] {
        let mut command = Command::new("node");
        command.arg(script("three_room.mjs")).arg(set("MATEVAL_GLTF_NODE_MODULES"));
        let scene = written(&mut command, &folder.path().join(name));
        let expected =
            ["box", "mirrored", "patchwork paint", "patchwork metal", "ball", "pane", "piano", "lamp", "bulb", "spot"];
        assert_eq!(names(&scene), BTreeSet::from(expected), "{name}");
        // The lamp, the bulb, the spot and the sun.
        assert_eq!(scene.scene.lights.len(), 4);
        assert!(scene.camera.is_some());
        let has = |word: &str| scene.findings.iter().any(|finding| finding.message.contains(word));
        assert!(has("KHR_materials_clearcoat") && has("points and lines"), "{:?}", scene.findings);
    }
}
