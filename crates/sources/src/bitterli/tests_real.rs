//! Real scenes, from the shared data.

use mateval_scene::Severity;
use mateval_testkit::data::shared_data;

use super::*;

/// The scene; none where the shared data are missing.
fn real(file: &str) -> Option<BitterliScene> {
    let path = shared_data(&format!("bitterli/{file}"))?;
    Some(read(&path, None, &Limits::default()).unwrap())
}

/// The triangles of the OBJ files. Rectangles and disks come in addition.
fn file_triangles(scene: &BitterliScene) -> usize {
    let of_files = |name: &&mateval_scene::reference::Surface| name.name != "rectangle" && name.name != "disk";
    scene.scene.surfaces.iter().filter(of_files).map(|s| s.mesh.triangles.len()).sum()
}

fn warnings(scene: &BitterliScene) -> Vec<String> {
    let above_note = scene.findings.iter().filter(|f| f.severity != Severity::Note);
    above_note.map(|f| format!("{} {} {}", f.code, f.file, f.place)).collect()
}

#[test]
fn staircase2() {
    let Some(scene) = real("staircase2/scene.xml") else { return };
    assert_eq!((file_triangles(&scene), scene.scene.surfaces.len(), scene.scene.lights.len()), (30_911, 32, 13));
    assert_eq!(warnings(&scene), [""; 0]);
    assert_eq!(scene.title, "'Modern Hall' by NewSee2l035");
    assert_eq!((scene.camera.intrinsics.width, scene.camera.intrinsics.height), (1280, 720));
}

#[test]
fn living_room() {
    for file in ["living-room/scene.xml", "living-room/scene_v0.6_dppm.xml"] {
        let Some(scene) = real(file) else { return };
        assert_eq!((file_triangles(&scene), scene.scene.surfaces.len(), scene.scene.lights.len()), (143_163, 65, 1));
        assert_eq!(warnings(&scene), [""; 0]);
    }
}

#[test]
fn bathroom() {
    for file in ["bathroom/scene.xml", "bathroom/scene_v0.6_dppm.xml"] {
        let Some(scene) = real(file) else { return };
        assert_eq!((file_triangles(&scene), scene.scene.surfaces.len()), (380_288, 856 - 3));
        let missing: Vec<_> = scene.findings.iter().filter(|f| f.code == "missing_file").map(|f| &f.file).collect();
        assert_eq!(missing, ["models/Mesh206.obj", "models/Mesh263.obj", "models/Mesh381.obj", "textures/rug.png"]);
        assert_eq!(warnings(&scene).len(), 4, "{:?}", warnings(&scene));
    }
}
