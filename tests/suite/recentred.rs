//! `baseline import` of meshes as generators return them: centred, scaled, with other axes, with WebP textures.

use std::fmt::Write as _;

use glam::vec3;
use mateval_dataset::TriangleMesh;
use mateval_dataset::mesh::bounds;
use serde_json::{Value, json};

use super::importing::{import, nodes, srgb, write_gltf, write_meshes};
use super::lifting::{GT_SUMMARY, ROOM, boxes, is_all, psnr, summary_of};
use super::sample::json as read_json;

/// The mesh as TRELLIS.2 returns it: the middle of its box at the origin, the longest side 0.99999; then Z up.
fn recentred(mesh: &TriangleMesh) -> TriangleMesh {
    let [low, high] = bounds(mesh.positions.iter().copied()).unwrap();
    let scale = 0.99999 / (high - low).max_element();
    let places = mesh.positions.iter().map(|place| (*place - (low + high) / 2.0) * scale);
    TriangleMesh { positions: places.map(|p| vec3(p.x, -p.z, p.y)).collect(), ..mesh.clone() }
}

#[test]
fn recentred_meshes_score_as_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let [files, out] = ["files", "out"].map(|name| folder.path().join(name));
    let count = write_meshes(&files, |_| true, recentred);
    assert!(count > 10, "{count}");
    let done = import(&ROOM, &files, &out, &["--format", "json"]).ends_with(0);
    let report: Value = serde_json::from_str(&done.stdout).unwrap();
    let instances = report["scenes"][0]["instances"].as_array().unwrap();
    for instance in instances {
        let frame = &instance["frame"];
        assert!(frame["state"] == "moved" && frame["residual_m"].as_f64().unwrap() < 1e-4, "{instance}");
        // All have the generator's axes, even those that are symmetric.
        assert_eq!(frame["rotation"], json!([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), "{instance}");
    }
    assert_eq!(instances.len(), count);
    let notes =
        done.stderr.lines().filter(|line| line.contains("was moved to the dataset's world space: axes (x, z, -y)"));
    assert_eq!(notes.count(), count);
    let (ours, truth) = (summary_of(&ROOM, &out), &*GT_SUMMARY);
    for key in ["albedo.input", "albedo.novel"] {
        assert!(psnr(&ours, key) > psnr(truth, key) - 1.0, "{key}: {ours} {truth}");
    }
    // Twin: sheared as well, no similarity explains them. What was tried is reported. Three meshes, since each texel is
    // compared with all triangles of a mesh that lies so far away.
    let sheared = folder.path().join("sheared");
    let some = ["rug", "sofa", "shelf"];
    let is_some = |id: &str| some.contains(&id);
    let count = write_meshes(&sheared, is_some, |mesh| {
        let mesh = recentred(mesh);
        let places = mesh.positions.iter().map(|p| vec3(p.x + 0.7 * p.y + 0.3 * p.z + 20.0, 1.3 * p.y, p.z));
        TriangleMesh { positions: places.collect(), ..mesh.clone() }
    });
    assert_eq!(count, some.len());
    let none = folder.path().join("none");
    import(&ROOM, &sheared, &none, &[]).ends_with(2).says("tried equal triangles, and the boxes of both meshes");
    assert!(!none.exists());
}

/// A mesh whose triangles are in order may be turned by any angle; one that no similarity explains is reported beside
/// it.
#[test]
fn equal_triangles_may_be_turned_by_any_angle() {
    let (folder, dataset) = boxes();
    let [files, out] = ["files", "out"].map(|name| folder.path().join(name));
    std::fs::create_dir_all(files.join("room")).unwrap();
    let turn = glam::Quat::from_axis_angle(vec3(0.6, 0.0, 0.8), 0.7);
    for (id, stretch) in [("red", 1.0), ("green", 2.0)] {
        let mesh = nodes(&dataset).into_iter().find(|node| node.name == id).unwrap().mesh;
        let mut text = "mtllib it.mtl\nusemtl it\n".to_owned();
        for p in &mesh.positions {
            let p = turn * (vec3(stretch * p.x, p.y, p.z) * 0.3 + vec3(1.0, 9.0, 2.0));
            writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
        }
        for [a, b, c] in mesh.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + 1)) {
            writeln!(text, "f {a} {b} {c}").unwrap();
        }
        std::fs::write(files.join("room").join(id).with_extension("obj"), text).unwrap();
    }
    std::fs::write(files.join("room/it.mtl"), "newmtl it\nKd 0.2 0.4 0.6\n").unwrap();
    let done = import(&dataset, &files, &out, &[]).ends_with(0);
    let done = done.says("'room/red.obj' was moved").says("turned by 40.11 degrees, scale 3.33333");
    done.prints("green: nothing in 'room/green.obj' is near enough").prints("no scale, turn and shift brings it there");
    assert!(is_all(&dataset, &out, "red", [0.2, 0.4, 0.6]) && !out.join("scenes/room/green").exists());
}

#[test]
fn webp_textures_of_a_gltf_are_read() {
    let (folder, dataset) = boxes();
    let [files, out] = ["files", "out"].map(|name| folder.path().join(name));
    write_gltf(&dataset, &files, ["red", "green"]);
    std::fs::remove_file(files.join("the picture.png")).unwrap();
    let picture = image::RgbImage::from_fn(8, 8, |x, _| image::Rgb(if x < 4 { [0; 3] } else { [188, 10, 99] }));
    picture.save(files.join("picture.webp")).unwrap();
    let mut file = read_json(&files.join("room.gltf"));
    file["images"] = json!([{ "uri": "picture.webp" }]);
    file["textures"] = json!([{ "extensions": { "EXT_texture_webp": { "source": 0 } } }]);
    file["extensionsUsed"] = json!(["KHR_texture_transform", "EXT_texture_webp"]);
    file["extensionsRequired"] = json!(["EXT_texture_webp"]);
    let write = |file: &Value| std::fs::write(files.join("room.gltf"), file.to_string()).unwrap();
    write(&file);
    import(&dataset, &files, &out, &[]).ends_with(0);
    assert!(is_all(&dataset, &out, "red", srgb([188, 10, 99])));
    // Twins: a cut picture, and another extension that is required.
    let whole = std::fs::read(files.join("picture.webp")).unwrap();
    std::fs::write(files.join("picture.webp"), &whole[..whole.len() / 2]).unwrap();
    let bad = folder.path().join("bad");
    import(&dataset, &files, &bad, &[]).ends_with(2).says("picture.webp");
    file["extensionsRequired"] = json!(["EXT_texture_webp", "KHR_texture_basisu"]);
    write(&file);
    import(&dataset, &files, &bad, &[]).ends_with(2).says("KHR_texture_basisu: Unsupported extension");
}

/// The groups of a scene's mesh are moved together, and each gives its colour to the instance that it is named after.
#[test]
fn a_mesh_of_a_scene_is_moved_as_a_whole() {
    let (folder, dataset) = boxes();
    let [files, out] = ["files", "out"].map(|name| folder.path().join(name));
    std::fs::create_dir_all(&files).unwrap();
    let (mut text, mut first) = ("mtllib it.mtl\n".to_owned(), 1);
    for id in ["red", "green"] {
        let mesh = nodes(&dataset).into_iter().find(|node| node.name == id).unwrap().mesh;
        writeln!(text, "o {id}\nusemtl {id}").unwrap();
        for p in &mesh.positions {
            writeln!(text, "v {} {} {}", 0.25 * p.x + 3.0, -0.25 * p.z + 4.0, 0.25 * p.y + 5.0).unwrap();
        }
        for [a, b, c] in mesh.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)) {
            writeln!(text, "f {a} {b} {c}").unwrap();
        }
        first += mesh.positions.len() as u32;
    }
    std::fs::write(files.join("room.obj"), text).unwrap();
    std::fs::write(files.join("it.mtl"), "newmtl red\nKd 0.2 0.4 0.6\nnewmtl green\nKd 0.6 0.4 0.2\n").unwrap();
    let done = import(&dataset, &files, &out, &[]).ends_with(0);
    let notes: Vec<&str> = done.stderr.lines().filter(|line| line.starts_with("note: ")).collect();
    let expected = "note: 'room.obj' was moved to the dataset's world space: axes (x, z, -y), scale 4.00000";
    assert!(notes.len() == 1 && notes[0].starts_with(expected), "{notes:?}");
    assert!(is_all(&dataset, &out, "red", [0.2, 0.4, 0.6]) && is_all(&dataset, &out, "green", [0.6, 0.4, 0.2]));
}
