//! `baseline import`: meshes with their own uv, textured glTF and OBJ, and one material for each part.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use mateval_dataset::uv_atlas::UvAtlas;
use mateval_dataset::{TriangleMesh, glb};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::transfer::byte_from_unit;
use mateval_image::{Picture, Wrap, png_io};
use serde_json::{Value, json};

use super::command::{Run, mateval, run};
use super::lifting::{GT, GT_SUMMARY, ROOM, boxes, is_all, psnr, summary_of};

pub fn import(dataset: &Path, files: &Path, out: &Path, words: &[&str]) -> Run {
    let mut command = mateval();
    command.args(["baseline", "import"]).arg(files).arg("--dataset").arg(dataset).arg("--out").arg(out);
    run(command.args(words))
}

pub fn nodes(dataset: &Path) -> Vec<glb::GlbNode> {
    glb::read(&dataset.join("scenes/room/geometry/instances.glb")).unwrap()
}

pub fn mesh_of(dataset: &Path, id: &str) -> TriangleMesh {
    nodes(dataset).into_iter().find(|node| node.name == id).unwrap().mesh
}

/// An OBJ of the mesh with moved positions, changed uv and reversed order of triangles.
fn obj(mesh: &TriangleMesh, moved: [f32; 3], uv: impl Fn([f32; 2]) -> [f32; 2]) -> String {
    let mut text = "mtllib it.mtl\nusemtl it\n".to_owned();
    for p in &mesh.positions {
        writeln!(text, "v {} {} {}", p.x + moved[0], p.y + moved[1], p.z + moved[2]).unwrap();
    }
    for p in mesh.uvs.as_ref().unwrap() {
        let [u, v] = uv(p.to_array());
        writeln!(text, "vt {u} {v}").unwrap();
    }
    for [a, b, c] in mesh.triangles.iter().rev().map(|triangle| triangle.map(|vertex| vertex + 1)) {
        writeln!(text, "f {b}/{b} {c}/{c} {a}/{a}").unwrap();
    }
    text
}

/// Writes the truth's atlas into a quarter of a larger picture, whose rest is magenta.
fn write_quarter(from: &Path, to: &Path) {
    let atlas = read_texture(from, Encoding::Linear, Wrap::Clamp).unwrap();
    let size = atlas.width();
    let byte = |x, y| atlas.texel(x, y).map(byte_from_unit);
    let quarter = |x: usize, y: usize| if x >= size && y >= size { byte(x - size, y - size) } else { [255, 0, 255] };
    png_io::write_rgb_bytes(to, &Picture::from_fn(2 * size, 2 * size, quarter)).unwrap();
}

/// Writes the changed meshes of the instances that `is_written` accepts, with the truth's textures in a quarter of
/// larger pictures; returns their number.
pub fn write_meshes(
    files: &Path,
    is_written: impl Fn(&str) -> bool,
    change: impl Fn(&TriangleMesh) -> TriangleMesh,
) -> usize {
    std::fs::create_dir_all(files.join("room")).unwrap();
    let mut count = 0;
    for node in nodes(&ROOM) {
        let truth = GT.join("scenes/room").join(&node.name);
        if !(truth.is_dir() && is_written(&node.name)) {
            continue;
        }
        let (id, own) = (&node.name, |name: &str| files.join("room").join(format!("{}{name}", node.name)));
        let mut mtl = "newmtl it\nKd 0.8 0.8 0.8\n".to_owned();
        for (map, word) in [("base_color", "map_Kd"), ("roughness", "map_Pr"), ("metallic", "map_Pm")] {
            write_quarter(&truth.join(map).with_extension("png"), &own(&format!("-{map}.png")));
            writeln!(mtl, "{word} {id}-{map}.png").unwrap();
        }
        std::fs::write(own(".mtl"), mtl).unwrap();
        let text = obj(&change(&node.mesh), [0.0; 3], |[u, v]| [(u + 1.0) / 2.0, v / 2.0]);
        std::fs::write(own(".obj"), text.replace("it.mtl", &format!("{id}.mtl"))).unwrap();
        count += 1;
    }
    count
}

#[test]
fn the_truth_in_other_uv_scores_as_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let [files, out] = ["files", "out"].map(|name| folder.path().join(name));
    let count = write_meshes(&files, |_| true, TriangleMesh::clone);
    assert!(count > 10, "{count}");
    import(&ROOM, &files, &out, &["--method", "mine"]).ends_with(0);
    let (ours, truth) = (summary_of(&ROOM, &out), &*GT_SUMMARY);
    for key in ["albedo.input", "albedo.novel"] {
        assert!(psnr(&ours, key) > psnr(truth, key) - 1.0, "{key}: {ours} {truth}");
    }
    for map in ["roughness", "metallic"] {
        let read = |root: &Path| {
            let path = root.join("scenes/room/floor").join(map).with_extension("png");
            read_texture(&path, Encoding::Linear, Wrap::Clamp).unwrap()
        };
        let (ours, truth) = (read(&out), read(&GT));
        let size = truth.width();
        let places = (0..size).flat_map(|x| (0..size).map(move |y| (x, y)));
        let apart = places.filter(|&(x, y)| (ours.texel(x, y)[0] - truth.texel(x, y)[0]).abs() > 0.01).count();
        assert!(apart * 100 < size * size, "{map}: {apart} of {size} x {size} texels");
    }
}

/// A `.gltf` of the boxes beside its `.bin` and a picture whose left half is black: below a node that shifts and
/// mirrors,
/// `red` looks its right half up by a transform of its uv, `green` has colours at its vertices.
pub fn write_gltf(dataset: &Path, files: &Path, names: [&str; 2]) {
    let mut bytes = Vec::new();
    let mut views = Vec::new();
    let mut view = |bytes: &mut Vec<u8>, data: Vec<u8>| {
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": data.len() }));
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        views.len() - 1
    };
    let floats = |all: &mut dyn Iterator<Item = f32>| all.flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    let (mut accessors, mut meshes) = (Vec::new(), Vec::new());
    for (material, id) in ["red", "green"].into_iter().enumerate() {
        let mesh = mesh_of(dataset, id);
        let count = mesh.positions.len();
        let first = accessors.len();
        // The parent node undoes it: x mirrored, one metre up.
        let places = floats(&mut mesh.positions.iter().flat_map(|p| [-p.x, p.y - 1.0, p.z]));
        let (low, high) = ([-9.0, -9.0, -9.0], [9.0, 9.0, 9.0]);
        accessors.push(json!({ "bufferView": view(&mut bytes, places), "componentType": 5126, "count": count, "type": "VEC3", "min": low, "max": high }));
        let uvs = floats(&mut mesh.uvs.unwrap().iter().flat_map(|uv| [uv.x, uv.y]));
        accessors.push(
            json!({ "bufferView": view(&mut bytes, uvs), "componentType": 5126, "count": count, "type": "VEC2" }),
        );
        let colors = if material == 1 { [0, 128, 255, 255] } else { [255; 4] };
        let colors = (0..count).flat_map(|_| colors).collect();
        accessors.push(json!({ "bufferView": view(&mut bytes, colors), "componentType": 5121, "normalized": true, "count": count, "type": "VEC4" }));
        let flipped = mesh.triangles.iter().flat_map(|[a, b, c]| [*a as u16, *c as u16, *b as u16]);
        let indices: Vec<u8> = flipped.flat_map(u16::to_le_bytes).collect();
        accessors.push(json!({ "bufferView": view(&mut bytes, indices), "componentType": 5123, "count": 3 * mesh.triangles.len(), "type": "SCALAR" }));
        let attributes = json!({ "POSITION": first, "TEXCOORD_0": first + 1, "COLOR_0": first + 2 });
        meshes
            .push(json!({ "primitives": [{ "attributes": attributes, "indices": first + 3, "material": material }] }));
    }
    let transform = json!({ "KHR_texture_transform": { "offset": [0.75, 0.5], "scale": [0.0, 0.0] } });
    let red = json!({ "pbrMetallicRoughness": { "roughnessFactor": 0.25, "metallicFactor": 0.75,
        "baseColorTexture": { "index": 0, "extensions": transform } } });
    let green = json!({ "pbrMetallicRoughness": { "roughnessFactor": 1.0, "metallicFactor": 0.0 } });
    let file = json!({
        "asset": { "version": "2.0" }, "extensionsUsed": ["KHR_texture_transform"],
        "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "all", "scale": [-1, 1, 1], "translation": [0, 1, 0], "children": [1, 2] },
            { "name": names[0], "mesh": 0 }, { "name": names[1], "mesh": 1 }],
        "meshes": meshes, "materials": [red, green],
        "textures": [{ "source": 0 }], "images": [{ "uri": "the%20picture.png" }],
        "accessors": accessors, "bufferViews": views, "buffers": [{ "uri": "room.bin", "byteLength": bytes.len() }],
    });
    std::fs::create_dir_all(files).unwrap();
    std::fs::write(files.join("room.gltf"), file.to_string()).unwrap();
    std::fs::write(files.join("room.bin"), bytes).unwrap();
    let picture = Picture::from_fn(8, 8, |x, _| if x < 4 { [0; 3] } else { [188, 10, 99] });
    png_io::write_rgb_bytes(&files.join("the picture.png"), &picture).unwrap();
}

/// Whether all texels of a map have this byte.
fn is_byte(submission: &Path, instance: &str, map: &str, byte: u8) -> bool {
    let path = submission.join("scenes/room").join(instance).join(map).with_extension("png");
    let map = read_texture(&path, Encoding::Linear, Wrap::Clamp).unwrap();
    let places = (0..map.width()).flat_map(|x| (0..map.height()).map(move |y| (x, y)));
    places.map(|(x, y)| byte_from_unit(map.texel(x, y)[0])).all(|found| found == byte)
}

pub fn srgb(bytes: [u8; 3]) -> [f32; 3] {
    bytes.map(mateval_image::transfer::linear_from_srgb_byte)
}

/// Slivers a few texels wide, under a texture four times as fine as the atlas: every texel finds a point of the mesh.
#[test]
fn no_texel_is_lost_under_a_finer_texture() {
    let folder = tempfile::tempdir().unwrap();
    let [files, out] = ["files", "out"].map(|name| folder.path().join(name));
    std::fs::create_dir_all(files.join("room")).unwrap();
    let own = |name: &str| files.join("room").join(name);
    let ids = ["lamp_stand", "mirror_frame", "bowl"];
    for id in ids {
        let atlas = GT.join("scenes/room").join(id).join("base_color.png");
        let atlas = read_texture(&atlas, Encoding::Linear, Wrap::Clamp).unwrap();
        let size = 4 * atlas.width();
        let picture = Picture::from_fn(size, size, |x, y| atlas.texel(x / 4, y / 4).map(byte_from_unit));
        png_io::write_rgb_bytes(&own(&format!("{id}.png")), &picture).unwrap();
        std::fs::write(own(&format!("{id}.mtl")), format!("newmtl it\nmap_Kd {id}.png\n")).unwrap();
        let text = obj(&mesh_of(&ROOM, id), [0.0; 3], |uv| uv).replace("it.mtl", &format!("{id}.mtl"));
        std::fs::write(own(&format!("{id}.obj")), text).unwrap();
    }
    let done = import(&ROOM, &files, &out, &["--format", "json"]).ends_with(0);
    let report: Value = serde_json::from_str(&done.stdout).unwrap();
    for id in ids {
        let instances = report["scenes"][0]["instances"].as_array().unwrap();
        let reported = instances.iter().find(|instance| instance["instance"] == id).unwrap();
        assert!(reported["texels"].as_u64().unwrap() > 1000 && reported["texels_without"] == 0, "{reported}");
        let read = |root: &Path| {
            let path = root.join("scenes/room").join(id).join("base_color.png");
            read_texture(&path, Encoding::Linear, Wrap::Clamp).unwrap()
        };
        let (ours, truth, mesh) = (read(&out), read(&GT), mesh_of(&ROOM, id));
        let atlas = UvAtlas::new(&mesh, truth.width());
        let places = (0..truth.width()).flat_map(|x| (0..truth.width()).map(move |y| (x, y)));
        let owned: Vec<(usize, usize)> = places.filter(|&(x, y)| atlas.owner(x, y).is_some()).collect();
        let apart = |&&(x, y): &&(usize, usize)| {
            let (a, b) = (ours.texel(x, y), truth.texel(x, y));
            (0..3).any(|c| (a[c] - b[c]).abs() > 16.0 / 255.0)
        };
        let share = owned.iter().filter(apart).count() as f64 / owned.len() as f64;
        assert!(share < 0.04, "{id}: {share}");
    }
}

#[test]
fn a_textured_gltf_is_rebaked_node_by_node() {
    let (folder, dataset) = boxes();
    let [files, out] = ["files", "out"].map(|name| folder.path().join(name));
    write_gltf(&dataset, &files, ["red", "green"]);
    let done = import(&dataset, &files, &out, &["--format", "json"]).ends_with(0);
    let report: Value = serde_json::from_str(&done.stdout).unwrap();
    let instances = report["scenes"][0]["instances"].as_array().unwrap();
    let of = |id: &str| instances.iter().find(|instance| instance["instance"] == id).unwrap();
    for id in ["red", "green"] {
        assert_eq!((&of(id)["file"], &of(id)["texels_without"]), (&json!("room.gltf"), &json!(0)));
        assert!(of(id)["max_distance_m"].as_f64().unwrap() < 1e-6);
    }
    // The boxes touch, and no colour is transferred from one to the other.
    assert!(is_all(&dataset, &out, "red", srgb([188, 10, 99])));
    assert!(is_all(&dataset, &out, "green", [0.0, 128.0 / 255.0, 1.0]));
    assert!(is_byte(&out, "red", "roughness", 64) && is_byte(&out, "red", "metallic", 191));
    // No file describes the mirror: it has no maps, and the report states it.
    assert!(of("mirror")["file"].is_null() && !out.join("scenes/room/mirror").exists());
    import(&dataset, &files, &out, &[]).ends_with(2).says("--force");

    // Twin: without names the faces that touch cannot be distinguished.
    write_gltf(&dataset, &files, ["Cube.001", "Cube.002"]);
    let unnamed = folder.path().join("unnamed");
    import(&dataset, &files, &unnamed, &[])
        .ends_with(0)
        .prints("mirror: nothing in 'room.gltf' is near enough, the nearest is 116.978 mm away");
    assert!(
        !is_all(&dataset, &unnamed, "red", srgb([188, 10, 99]))
            || !is_all(&dataset, &unnamed, "green", [0.0, 128.0 / 255.0, 1.0])
    );
}

#[test]
fn distances_and_texels_without_a_match_are_reported() {
    let (folder, dataset) = boxes();
    let files = folder.path().join("files");
    std::fs::create_dir_all(files.join("room")).unwrap();
    std::fs::write(files.join("room/it.mtl"), "newmtl it\nKd 0.2 0.4 0.6\nPr 0.3\n").unwrap();
    let red = mesh_of(&dataset, "red");
    let write = |moved| std::fs::write(files.join("room/red.obj"), obj(&red, moved, |uv| uv)).unwrap();
    let report_of_red = |name: &str, words: &[&str]| {
        let words = [&["--format", "json"], words].concat();
        let done = import(&dataset, &files, &folder.path().join(name), &words).ends_with(0);
        let report: Value = serde_json::from_str(&done.stdout).unwrap();
        report["scenes"][0]["instances"].as_array().unwrap().iter().find(|i| i["instance"] == "red").unwrap().clone()
    };
    write([0.003, 0.0, 0.0]);
    let moved = report_of_red("moved", &[]);
    let max = moved["max_distance_m"].as_f64().unwrap();
    assert!((max - 0.003).abs() < 1e-5 && moved["texels_without"] == 0, "{moved}");
    assert!(is_all(&dataset, &folder.path().join("moved"), "red", [0.2, 0.4, 0.6]));
    // The MTL states no metallic: no map.
    assert!(!folder.path().join("moved/scenes/room/red/metallic.png").exists());
    // Two of six sides are further away than a millimetre.
    std::fs::write(files.join("room/rde.obj"), "").unwrap();
    for folder in ["rom", "textures"] {
        std::fs::create_dir(files.join(folder)).unwrap();
    }
    std::fs::write(files.join("rom/red.obj"), "").unwrap();
    std::fs::write(files.join("textures/red.png"), "").unwrap();
    let misspelt = import(&dataset, &files, &folder.path().join("misspelt"), &[]).ends_with(0);
    let misspelt = misspelt.says("'room/rde.obj' matches no scene").says("'rom/' matches no scene");
    assert!(!misspelt.stderr.contains("textures"), "{}", misspelt.stderr);
    let strict = report_of_red("strict", &["--max-distance", "0.001"]);
    let share = strict["texels_without"].as_f64().unwrap() / strict["texels"].as_f64().unwrap();
    assert!((0.28..0.4).contains(&share), "{strict}");
    // A box that is stretched and moved: no similarity explains it.
    let stretched = obj(&red, [0.0; 3], |uv| uv);
    let moved = stretched.lines().map(|line| match line.strip_prefix("v ") {
        None => format!("{line}\n"),
        Some(place) => {
            let [x, y, z] =
                <[f32; 3]>::try_from(place.split(' ').map(|v| v.parse().unwrap()).collect::<Vec<_>>()).unwrap();
            format!("v {} {y} {z}\n", 2.0 * x + 5.0)
        }
    });
    std::fs::write(files.join("room/red.obj"), moved.collect::<String>()).unwrap();
    let far = folder.path().join("far");
    let refused = import(&dataset, &files, &far, &[]).ends_with(2).says("the nearest 3.4").says("world space");
    refused.says("48 orders of axes: no box has the right proportions");
    assert!(!far.exists());
}

#[test]
fn one_material_a_part() {
    let (folder, dataset) = boxes();
    let files = folder.path().join("files");
    std::fs::create_dir(&files).unwrap();
    let write = |text: Value| std::fs::write(files.join("room.json"), text.to_string()).unwrap();
    write(json!({ "red": { "base_color": [0.1, 0.2, 0.3], "roughness": 0.5 }, "blue": { "base_color": [1, 1, 0] } }));
    let out = folder.path().join("out");
    import(&dataset, &files, &out, &[]).ends_with(0).prints("2 of").prints("green: no file describes it");
    assert!(is_all(&dataset, &out, "red", [0.1, 0.2, 0.3]) && is_all(&dataset, &out, "blue", [1.0, 1.0, 0.0]));
    // By part, which takes precedence over its instance.
    let scene: Value = super::sample::json(&dataset.join("scenes/room/scene.json"));
    let part = scene["parts"].as_array().unwrap().iter().find(|part| part["instance"] == "red").unwrap()["id"].clone();
    write(json!({ "red": { "base_color": [0, 0, 0] }, part.as_str().unwrap(): { "base_color": [0.7, 0.2, 0.3] } }));
    let by_part = folder.path().join("by_part");
    import(&dataset, &files, &by_part, &[]).ends_with(0);
    assert!(is_all(&dataset, &by_part, "red", [0.7, 0.2, 0.3]));
    // A file without any known name.
    write(json!({}));
    import(&dataset, &files, &folder.path().join("empty"), &[]).ends_with(2).says("name no part or instance");
    // All faults are reported at once.
    write(json!({ "no-such": { "base_color": [0, 0, 0] }, "red": { "base_color": [0, 0, 2] } }));
    let bad = import(&dataset, &files, &folder.path().join("bad"), &[]).ends_with(2);
    bad.says("/no-such: expected the id of a part").says("/red: expected numbers from 0 to 1");
}

#[test]
fn what_cannot_be_imported_is_refused_with_the_reason() {
    let (folder, dataset) = boxes();
    let files = folder.path().join("files");
    let room = files.join("room");
    std::fs::create_dir_all(&room).unwrap();
    let out = folder.path().join("out");
    import(&dataset, &files, &out, &[]).ends_with(2).says("<scene>/<instance>.glb");
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    std::fs::write(folder.path().join("outside.mtl"), "newmtl it\nKd 1 1 1\n").unwrap();
    let cases: [(&str, String, &str); 8] = [
        ("red.obj", format!("mtllib ../../outside.mtl\nusemtl it\n{triangle}f 1 2 3\n"), "leads out"),
        ("red.obj", format!("{triangle}f 1 2 3\n"), "faces without `usemtl`"),
        ("red.obj", format!("mtllib map.mtl\nusemtl it\n{triangle}f 1 2 3\n"), "'room/a.png' does not exist"),
        ("red.obj", format!("mtllib none.mtl\nusemtl it\n{triangle}f 1 2 3\n"), "does not exist"),
        ("red.obj", format!("{triangle}f 1 2 9\n"), "line 5"),
        ("red.gltf", "{}".to_owned(), "not valid glTF"),
        ("red.glb", "glTF".to_owned(), "not valid glTF"),
        (
            "red.gltf",
            json!({ "asset": { "version": "2.0" }, "buffers": [{ "uri": "../../recipe.toml", "byteLength": 4 }],
                "scenes": [{ "nodes": [] }] })
            .to_string(),
            "leads out",
        ),
    ];
    std::fs::write(room.join("map.mtl"), "newmtl it\nmap_Kd a.png\n").unwrap();
    for (name, text, reason) in cases {
        let path: PathBuf = room.join(name);
        std::fs::write(&path, text).unwrap();
        import(&dataset, &files, &out, &[]).ends_with(2).says(reason).says(name);
        assert!(!out.exists());
        std::fs::remove_file(path).unwrap();
    }
}
