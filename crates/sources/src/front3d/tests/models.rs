//! Models: faulty OBJ files, ids that are paths, the parts of a sound model, and roughness and metallic by what the
//! data states of models, their groups, and architecture.

use mateval_dataset::material::MaterialClass;
use mateval_dataset::material::{Material, MaterialModel, ScalarInput};

use super::*;

const SOUND: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

/// The small house with a piece of the model `jid` on its floor.
fn with_piece(jid: &str) -> Value {
    let mut json = small_house();
    json["furniture"] = json!([{"uid": "p", "jid": jid, "valid": true}]);
    let children = json["scene"]["room"][0]["children"].as_array_mut().unwrap();
    children.push(json!({"ref": "p", "instanceid": "furniture/1", "pos": [2, 0, 2]}));
    json
}

fn furnished_with(jid: &str, obj: &[u8]) -> FurnishedHouse {
    let folder = tempfile::tempdir().unwrap();
    let files = lone_house(folder.path(), with_piece(jid).to_string().as_bytes());
    std::fs::create_dir(folder.path().join("models/x")).unwrap();
    std::fs::write(folder.path().join("models/x/raw_model.obj"), obj).unwrap();
    // Outside the models' folder, where no id may lead.
    std::fs::create_dir(folder.path().join("y")).unwrap();
    std::fs::write(folder.path().join("y/raw_model.obj"), SOUND).unwrap();
    let house = furnish(&files, &Limits::default()).unwrap();
    assert_sound(&house);
    house
}

fn pieces(house: &FurnishedHouse) -> Vec<&TriangleMesh> {
    let all = house.placed.iter().zip(&house.scene.surfaces);
    all.filter(|(placed, _)| placed.origin.role.is_furniture()).map(|(_, surface)| &surface.mesh).collect()
}

#[test]
fn faulty_models_are_findings() {
    for obj in [
        &b""[..],
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\n",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -99999999999999999999\n",
        b"v 0 0 0\nv 1e30 0 0\nv 0 1e30 0\nf 1 2 3\n",
        b"v 0 0 0\nv nan 0 0\nv 0 inf 0\nf 1 2 3\n",
        b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n",
        b"v a b c\nf 1 1 1\n",
        b"v 0 0\nf 1 1 1\n",
        b"g Shadow\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        b"\x89PNG\r\n\x1a\n\0\0\0\xff",
    ] {
        let house = furnished_with("x", obj);
        let text = String::from_utf8_lossy(obj).into_owned();
        assert!(pieces(&house).is_empty(), "{text:?}");
        let found = house.findings.iter().find(|finding| finding.code == "bad_model");
        assert_eq!(found.map(|finding| finding.file.as_str()), Some("models/x/raw_model.obj"), "{text:?}");
        assert_eq!(house.wanted_pieces, [1]);
    }
    // Twin.
    let house = furnished_with("x", SOUND.as_bytes());
    assert_eq!(pieces(&house).len(), 1);
    assert!(house.findings.iter().all(|finding| finding.code != "bad_model"));
}

/// One vertex that is far away does not cause the others' metres to be read as centimetres.
#[test]
fn a_wild_vertex_does_not_shrink_a_model() {
    for wild in ["1e30 0 0", "0 -1e20 0", "nan 0 0"] {
        let house = furnished_with("x", format!("{SOUND}v {wild}\nf 1 2 5\n").as_bytes());
        let [mesh] = pieces(&house)[..] else { panic!("{wild}") };
        assert!((size(mesh) - Vec3::ONE).length() < 1e-6, "{wild} {}", size(mesh));
        assert!(house.findings.iter().any(|finding| finding.code == "zero_area"), "{wild}");
    }
    // Twin: a model that is large as a whole is in centimetres.
    let large: String = SOUND
        .lines()
        .map(|line| {
            let line = if line.starts_with('v') { line.replace(" 1", " 100") } else { line.to_owned() };
            line + "\n"
        })
        .collect();
    let house = furnished_with("x", large.as_bytes());
    assert!((size(pieces(&house)[0]) - Vec3::ONE).length() < 1e-6);
}

#[test]
fn ids_are_no_paths() {
    let long = "x".repeat(100);
    for jid in ["../y", "../../etc", "/etc", "..", ".", "x/../../y", "x/", "C:x", "x\0", "\\\\y", "", "植物", &long] {
        let house = furnished_with(jid, SOUND.as_bytes());
        assert!(pieces(&house).is_empty(), "{jid:?}");
        assert!(house.findings.iter().any(|f| f.code == "bad_jid" && f.place == "/furniture/0/jid"), "{jid:?}");
        assert!(house.findings.iter().all(|f| !f.message.contains('\0') && f.message.len() < 500));
        let read: Vec<&str> = house.files.hashes.iter().map(|(file, _)| file.as_str()).collect();
        assert_eq!(read, ["h.json"], "{jid:?}");
    }
    let house = furnished_with("x", SOUND.as_bytes());
    assert!(house.files.hashes.iter().any(|(file, _)| file == "models/x/raw_model.obj"));
}

/// Ids of textures are as untrusted as those of models.
#[test]
fn ids_of_textures_are_no_paths() {
    for jid in ["../y", "/etc", "..", "x\0", "a/b"] {
        let mut json = small_house();
        json["material"][0]["jid"] = jid.into();
        let folder = tempfile::tempdir().unwrap();
        let files = lone_house(folder.path(), json.to_string().as_bytes());
        let house = furnish(&HouseFiles { textures: Some("models".into()), ..files }, &Limits::default()).unwrap();
        assert!(house.findings.iter().any(|f| f.code == "bad_jid" && f.place == "/material/0/jid"), "{jid:?}");
        assert_sound(&house);
    }
}

#[cfg(unix)]
#[test]
fn links_do_not_lead_out() {
    let folder = tempfile::tempdir().unwrap();
    let files = lone_house(folder.path(), with_piece("x").to_string().as_bytes());
    std::fs::create_dir(folder.path().join("y")).unwrap();
    std::fs::write(folder.path().join("y/raw_model.obj"), SOUND).unwrap();
    std::os::unix::fs::symlink(folder.path().join("y"), folder.path().join("models/x")).unwrap();
    let house = furnish(&files, &Limits::default()).unwrap();
    assert!(pieces(&house).is_empty());
    assert!(house.findings.iter().any(|f| f.code == "path_escapes"));
}

/// Two groups, of which the first has two components: three parts, the largest first.
#[test]
fn parts_are_the_connected_components_of_groups() {
    let quad = |x: f64, size: f64, first: usize| {
        let (a, b, c, d) = (first, first + 1, first + 2, first + 3);
        let corner = |u: f64, v: f64| format!("v {} {} 0\n", x + u * size, v * size);
        let corners: String = [corner(0., 0.), corner(1., 0.), corner(1., 1.), corner(0., 1.)].concat();
        (corners, format!("f {a} {b} {c} {d}\n"))
    };
    let quads = [quad(0.0, 0.5, 1), quad(2.0, 1.0, 5), quad(2.0, 1.0, 9)];
    let corners: String = quads.iter().map(|(corners, _)| corners.as_str()).collect();
    let obj = format!("{corners}g one\n{}{}g two\n{}", quads[0].1, quads[1].1, quads[2].1);
    let house = furnished_with("x", obj.as_bytes());
    let at = house.placed.iter().position(|placed| placed.origin.role.is_furniture()).unwrap();
    // Group two lies where the second quad of group one does, but is a separate part.
    assert_eq!(house.placed[at].origin.part_of_triangle.as_deref(), Some(&[2, 2, 0, 0, 1, 1][..]));
}

/// Two triangles of a group of metal, which shares an edge with one of another group.
const TABLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n\
    g metal_legs\nf 1/1 3/2 2/3\nf 1/1 2/2 4/3\ng solid_001\nf 1/1 4/2 3/3\n";

fn stated(files: HouseFiles, seed: u64) -> FurnishedHouse {
    furnish(&HouseFiles { appearance: AppearanceRule::Stated { seed }, ..files }, &Limits::default()).unwrap()
}

/// The small house with two copies of a model of the groups above, which `model_info.json` says is of marble.
fn tables(folder: &Path, obj: &str) -> HouseFiles {
    let mut json = with_piece("x");
    let children = json["scene"]["room"][0]["children"].as_array_mut().unwrap();
    children.push(json!({"ref": "p", "instanceid": "furniture/2", "pos": [1, 0, 1]}));
    let files = lone_house(folder, json.to_string().as_bytes());
    std::fs::create_dir(folder.join("models/x")).unwrap();
    std::fs::write(folder.join("models/x/raw_model.obj"), obj).unwrap();
    let info = json!([{"model_id": "x", "super-category": "Table", "category": null, "material": "Marble"}]);
    std::fs::write(folder.join("models/model_info.json"), info.to_string()).unwrap();
    files
}

fn numbers(material: &Material) -> [ScalarInput; 2] {
    let MaterialModel::Principled { roughness, metallic, .. } = material.model else { panic!("{material:?}") };
    [roughness, metallic]
}

/// Roughness and metallic at the corners of a triangle, all equal.
fn at_triangle(house: &FurnishedHouse, surface: usize, triangle: usize) -> [f32; 2] {
    let surface = &house.scene.surfaces[surface];
    let textures = house.scene.texture_list();
    let uvs = surface.mesh.uvs.as_ref().unwrap();
    let at = |vertex: u32| {
        numbers(&house.scene.materials[surface.material.0]).map(|input| input.at(&textures, uvs[vertex as usize]))
    };
    let [first, second, third] = surface.mesh.triangles[triangle].map(at);
    assert!(first == second && second == third, "{first:?} {second:?} {third:?}");
    first
}

#[test]
fn groups_of_a_model_have_their_own_class() {
    let folder = tempfile::tempdir().unwrap();
    let house = stated(tables(folder.path(), TABLE), 0);
    assert_sound(&house);
    // The floor comes first, then both copies.
    for copy in [1, 2] {
        let parts = house.placed[copy].origin.class_of_part.clone().unwrap();
        assert_eq!(parts, [Some(MaterialClass::Metal), Some(MaterialClass::Stone)]);
        let numbers = [0, 1, 2].map(|triangle| at_triangle(&house, copy, triangle));
        assert_eq!((numbers[0], numbers[0][1], numbers[2][1]), (numbers[1], 1.0, 0.0));
        assert!((0.2..=0.4).contains(&numbers[0][0]) && (0.1..=0.375).contains(&numbers[2][0]), "{numbers:?}");
    }
    assert_eq!(house.scene.surfaces[1].material, house.scene.surfaces[2].material);
    // Another seed draws another roughness of the same classes.
    let folder = tempfile::tempdir().unwrap();
    let other = stated(tables(folder.path(), TABLE), 1);
    assert_ne!(at_triangle(&other, 1, 0)[0], at_triangle(&house, 1, 0)[0]);
    assert_eq!(other.placed[1].origin.class_of_part, house.placed[1].origin.class_of_part);
}

/// Twin of the above: constants and no classes, and the same geometry.
#[test]
fn without_the_rule_everything_is_constant() {
    let folder = tempfile::tempdir().unwrap();
    let files = tables(folder.path(), TABLE);
    let house = furnish(&files, &Limits::default()).unwrap();
    for (placed, surface) in house.placed.iter().zip(&house.scene.surfaces) {
        assert_eq!(placed.origin.class_of_part, None);
        let constants = [0.5, 0.0].map(ScalarInput::Constant);
        assert_eq!(numbers(&house.scene.materials[surface.material.0]), constants);
    }
    let stated = stated(files, 0);
    let corners = |house: &FurnishedHouse| -> Vec<[Vec3; 3]> {
        let meshes = house.scene.surfaces.iter().map(|surface| &surface.mesh);
        meshes.flat_map(|mesh| (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle))).collect()
    };
    assert_eq!(corners(&house), corners(&stated));
}

#[test]
fn texture_coordinates_that_spread_too_far_cost_a_model_the_classes_of_its_groups() {
    let folder = tempfile::tempdir().unwrap();
    let house = stated(tables(folder.path(), &TABLE.replace("vt 1 0", "vt 1e6 0")), 0);
    assert!(house.findings.iter().any(|finding| finding.code == "spread_uv"));
    assert_eq!(house.placed[1].origin.class_of_part, Some(vec![Some(MaterialClass::Stone); 2]));
}

/// The test kit's house: content types of its architecture, materials of its models, and groups of glass.
#[test]
fn the_whole_house_has_many_classes() {
    let disk = Disk::bare();
    let house = stated(disk.files(), 0);
    assert_sound(&house);
    let mut classes: Vec<MaterialClass> = Vec::new();
    for placed in &house.placed {
        let parts = placed.origin.part_of_triangle.as_ref().unwrap();
        let of_parts = placed.origin.class_of_part.as_ref().unwrap();
        assert_eq!(of_parts.len(), 1 + parts.iter().max().unwrap());
        classes.extend(of_parts.iter().flatten());
    }
    classes.sort_unstable();
    classes.dedup();
    for class in [MaterialClass::Glass, MaterialClass::Wood, MaterialClass::Paint, MaterialClass::Tile] {
        assert!(classes.contains(&class), "{class} is not in {classes:?}");
    }
    assert!(classes.len() >= 5, "{classes:?}");
}
