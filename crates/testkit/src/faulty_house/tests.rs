//! The written house, read back without the reader of 3D-FRONT.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::Value;

use super::faults::{FAULTS, Place};
use super::*;

/// The house's JSON.
struct Layout(Value);

impl Layout {
    fn new() -> Self {
        Self(json())
    }

    fn list(&self, pointer: &str) -> &Vec<Value> {
        self.0.pointer(pointer).unwrap().as_array().unwrap()
    }

    /// Every child of the three rooms.
    fn children(&self) -> Vec<&Value> {
        (0..3).flat_map(|room| self.list(&format!("/scene/room/{room}/children"))).collect()
    }
}

/// The house as files.
struct Files(tempfile::TempDir);

impl Files {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path());
        Self(folder)
    }

    fn root(&self) -> PathBuf {
        self.0.path().join("house")
    }

    fn model(&self, jid: &Value) -> PathBuf {
        self.root().join("3D-FUTURE-model").join(jid.as_str().unwrap())
    }

    fn texture(&self, jid: &Value) -> PathBuf {
        self.root().join("3D-FRONT-texture").join(jid.as_str().unwrap()).join("texture.png")
    }
}

/// The faults of a mesh's lists, by their names in `FAULTS`.
fn mesh_faults(mesh: &Value, materials: &BTreeSet<&str>) -> Vec<&'static str> {
    let list = |key: &str| mesh[key].as_array().unwrap();
    let numbers = |key: &str| -> Vec<f64> { list(key).iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect() };
    let points = |values: &[f64]| -> Vec<DVec3> { values.as_chunks::<3>().0.iter().map(|&p| p.into()).collect() };
    let (xyz, normal, uv) = (numbers("xyz"), numbers("normal"), numbers("uv"));
    assert!(xyz.len() % 3 == 0 && xyz.len() >= 9 && uv.len() * 3 == xyz.len() * 2, "{mesh}");
    let corners = points(&xyz);
    let faces: Vec<usize> = list("faces").iter().map(|v| v.as_u64().unwrap() as usize).collect();
    let area = |f: &[usize; 3]| {
        let p = f.map(|i| corners.get(i).copied());
        p[0].zip(p[1]).zip(p[2]).map(|((a, b), c)| (b - a).cross(c - a).length())
    };
    let wrong = [
        ("mesh_aid_text", mesh["aid"].is_string()),
        ("mesh_without_faces", faces.is_empty()),
        ("mesh_uv_null", uv.iter().any(|v| v.is_nan())),
        ("mesh_index_out_of_range", faces.iter().any(|i| *i >= corners.len())),
        ("mesh_normals_not_unit", points(&normal).iter().any(|n| (n.length() - 1.0).abs() > 1e-3)),
        ("mesh_normals_short", normal.len() < xyz.len()),
        ("mesh_zero_area", faces.as_chunks().0.iter().filter_map(area).any(|area| area < 1e-9)),
        ("mesh_type_empty", mesh["type"] == ""),
        ("mesh_material_dangles", !materials.contains(mesh["material"].as_str().unwrap())),
    ];
    assert_eq!(faces.len() % 3, 0);
    wrong.into_iter().filter(|(_, is)| *is).map(|(name, _)| name).collect()
}

/// Every fault of a mesh is in the table, at its place, and the table has no other.
#[test]
fn meshes_have_exactly_the_listed_faults() {
    let house = Layout::new();
    let materials: BTreeSet<&str> = house.list("/material").iter().map(|m| m["uid"].as_str().unwrap()).collect();
    let mut found = BTreeSet::new();
    for (place, mesh) in house.list("/mesh").iter().enumerate() {
        found.extend(mesh_faults(mesh, &materials).into_iter().map(|name| (place, name)));
    }
    let described: BTreeSet<_> = FAULTS
        .iter()
        .filter_map(|fault| match fault.place {
            Place::Json { pointer } => {
                let place = pointer.strip_prefix("/mesh/")?.split('/').next()?.parse::<usize>().ok()?;
                Some((place, fault.name))
            }
            Place::File { .. } => None,
        })
        .collect();
    assert!(described.len() > 10, "{described:?}");
    assert_eq!(found, described);
    // All are in the third room, except for normals.
    let third: Vec<&Value> = house.list("/scene/room/2/children").iter().map(|child| &child["ref"]).collect();
    let elsewhere = described.iter().filter(|(place, _)| !third.contains(&&house.list("/mesh")[*place]["uid"]));
    assert!(elsewhere.map(|(_, name)| *name).all(|name| name == "mesh_normals_not_unit"));
}

/// Each mesh is the child of one room. Pieces refer to records, records to models and materials to textures, and the only
/// exceptions are those of the table.
#[test]
fn only_the_listed_references_are_broken() {
    let (house, files) = (Layout::new(), Files::new());
    let records: BTreeMap<&str, &Value> =
        house.list("/furniture").iter().rev().map(|record| (record["uid"].as_str().unwrap(), record)).collect();
    let (meshes, pieces): (Vec<&Value>, Vec<&Value>) =
        house.children().into_iter().partition(|child| child["instanceid"].as_str().unwrap().starts_with("mesh/"));
    let refs: Vec<&str> = meshes.iter().map(|child| child["ref"].as_str().unwrap()).collect();
    assert_eq!(refs, house.list("/mesh").iter().map(|mesh| mesh["uid"].as_str().unwrap()).collect::<Vec<_>>());
    assert_eq!(refs.iter().collect::<BTreeSet<_>>().len(), refs.len());
    let is_lost = |record: &&Value| record["valid"] == true && !files.model(&record["jid"]).is_dir();
    let uids = pieces.iter().map(|child| child["ref"].as_str().unwrap());
    let lost: Vec<&str> = uids.filter(|uid| records.get(uid).is_none_or(is_lost)).collect();
    assert_eq!(lost, ["3012/model", "9999/model"]);
    let materials = house.list("/material").iter().filter(|material| !files.texture(&material["jid"]).is_file());
    let without: BTreeSet<&str> = materials.map(|material| material["jid"].as_str().unwrap()).collect();
    assert_eq!(without, BTreeSet::from(["", "local", "cc0a0000-5a3b-4e00-8000-000000000900"]));
}

#[test]
fn each_fault_is_at_its_listed_place() {
    let (house, files) = (Layout::new(), Files::new());
    let mut checked = 0;
    for fault in FAULTS {
        let shows = match fault.place {
            Place::Json { pointer } if pointer.starts_with("/mesh/") => continue,
            Place::Json { pointer } => shows_in_json(&house, &files, fault.name, house.0.pointer(pointer).unwrap()),
            Place::File { path } => shows_in_file(fault.name, &files.root().join(path)),
        };
        assert!(shows, "{fault:?}");
        checked += 1;
    }
    assert_eq!(checked, FAULTS.len() - 11);
}

fn shows_in_json(house: &Layout, files: &Files, name: &str, at: &Value) -> bool {
    let numbers = || -> Vec<f64> { serde_json::from_value(at.clone()).unwrap() };
    let count = |list: &str| house.list(list).iter().filter(|entry| entry["uid"] == at["uid"]).count();
    let children = |room: &Value| -> Vec<Value> { room["children"].as_array().unwrap().clone() };
    match name {
        "furniture_uid_repeated" => count("/furniture") == 2,
        "material_uid_repeated" => count("/material") == 2,
        "category_chinese" => !at.as_str().unwrap().is_ascii(),
        "category_missing" => at.get("category").is_none() && at["valid"] == true,
        "category_null" => at.is_null(),
        "valid_false" => at == false,
        "valid_missing" => at.get("valid").is_none() && !files.model(&at["jid"]).exists(),
        "model_folder_missing" => !files.model(at).exists(),
        "material_jid_local" => at == "local",
        "material_jid_empty" => at == "",
        "material_use_color" => at == true,
        "material_texture_object" => at["value"] == "",
        "material_normal_texture" => at.as_str().unwrap().ends_with("normal.png"),
        "material_folder_missing" => !files.texture(at).exists() && at.as_str().unwrap().len() == 36,
        "room_without_ceiling" => {
            let is_ceiling = |child: &Value| {
                let mesh = house.list("/mesh").iter().find(|mesh| mesh["uid"] == child["ref"]);
                mesh.is_some_and(|mesh| mesh["type"].as_str().unwrap().contains("Ceiling"))
            };
            let lacks = |room: &Value| !children(room).iter().any(is_ceiling);
            lacks(at) && !lacks(&house.0["scene"]["room"][0])
        }
        "scale_uneven" => numbers()[0] != numbers()[2],
        "scale_mirrors" => numbers().iter().product::<f64>() < 0.0,
        "scale_tiny" => numbers().iter().all(|v| *v < 1e-5),
        "rotation_not_unit" => (numbers().iter().map(|v| v * v).sum::<f64>() - 1.0).abs() > 0.5,
        // Both are crates with sides of 0.5 m.
        "pieces_intersect" => {
            let other = &children(&house.0["scene"]["room"][2])[31]["pos"];
            let other: Vec<f64> = serde_json::from_value(other.clone()).unwrap();
            numbers().iter().zip(other).all(|(a, b)| (a - b).abs() < 0.5)
        }
        "child_without_record" => house.list("/furniture").iter().all(|record| &record["uid"] != at),
        _ => panic!("no test of {name}"),
    }
}

fn shows_in_file(name: &str, path: &Path) -> bool {
    let text = || std::fs::read_to_string(path).unwrap();
    let has = |lines: &[&str]| lines.iter().all(|wanted| text().lines().any(|line| line.trim() == *wanted));
    // The largest coordinate of a vertex.
    let reach = || {
        let text = text();
        let numbers = text.lines().filter_map(|line| line.strip_prefix("v ")).flat_map(str::split_whitespace);
        numbers.fold(0.0_f64, |most, number| most.max(number.parse::<f64>().unwrap().abs()))
    };
    let words = |head: &str, count: usize| {
        text().lines().filter(|line| line.starts_with(head)).any(|line| line.split_whitespace().count() == count)
    };
    match name {
        "model_not_listed" => {
            !text().contains("cc0f0000-5a3b-4e00-8000-000000000021")
                && text().contains("cc0f0000-5a3b-4e00-8000-000000000020")
        }
        "texture_alpha_zero" => alphas(path).iter().all(|alpha| *alpha == 0),
        "texture_grey_alpha" => png_reader(path).info().color_type == png::ColorType::GrayscaleAlpha,
        "texture_truncated" => {
            let mut reader = png_reader(path);
            let mut data = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut data).is_err()
        }
        "texture_missing" => !path.exists() && path.parent().unwrap().is_dir(),
        "model_shadow" => text().contains("g Shadow_001\n") && reach() == 3.0,
        "mtl_misleads" => has(&["Kd 0 0 0", "Tf 1 1 1", "Ke 1 1 1"]),
        "obj_quads" => words("f  ", 5),
        "obj_blanks" => text().contains("\nv  ") && text().contains("\nf  "),
        "obj_three_uvs" => words("vt ", 4) && text().lines().count() == text().matches("\r\n").count(),
        "obj_without_materials" => !text().contains("mtllib") && !text().contains("usemtl"),
        "model_centimetres" => reach() == 45.0,
        "model_drop_shadow" => {
            let opacities = alphas(&path.with_file_name("texture.png"));
            opacities.contains(&45) && opacities.contains(&193) && !text().contains("Shadow")
        }
        "model_flat" => {
            let text = text();
            let mut vertices = text.lines().filter_map(|line| line.strip_prefix("v "));
            vertices.all(|line| line.split_whitespace().nth(1) == Some("0.00000"))
        }
        _ => panic!("no test of {name}"),
    }
}

fn png_reader(path: &Path) -> png::Reader<std::io::Cursor<Vec<u8>>> {
    png::Decoder::new(std::io::Cursor::new(std::fs::read(path).unwrap())).read_info().unwrap()
}

fn alphas(path: &Path) -> Vec<u8> {
    let mut reader = png_reader(path);
    let mut data = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut data).unwrap();
    assert_eq!(reader.info().color_type, png::ColorType::Rgba);
    data.chunks_exact(4).map(|pixel| pixel[3]).collect()
}

/// The twins: files of a sound model show none of the faults.
#[test]
fn sound_files_show_no_fault() {
    let files = Files::new();
    let library = files.root().join("3D-FUTURE-model");
    let mut seen = 0;
    for fault in FAULTS {
        let Place::File { path } = fault.place else { continue };
        if fault.name != "model_not_listed" {
            let file = library.join("cc0f0000-5a3b-4e00-8000-000000000001").join(Path::new(path).file_name().unwrap());
            assert!(!shows_in_file(fault.name, &file), "{}", fault.name);
            seen += 1;
        }
    }
    assert_eq!(seen, 13);
}

/// As in the data, the origin is on the floor in the middle of the footprint, painted shadows aside.
#[test]
fn models_stand_on_their_origin() {
    for model in library::models().iter_mut() {
        if ["shelf", "basket"].contains(&model.name) {
            model.parts.pop();
        }
        let [low, high] = model.bounds();
        let middle = (low + high) / 2.0;
        assert!(low.y.abs() < 1e-9, "{} {low}", model.name);
        assert!(middle.x.abs() < 0.004 && middle.z.abs() < 0.004, "{} {middle}", model.name);
    }
}
