//! A house's JSON: the three releases of the data, every key that one of them lacks, and every fault of the test kit's
//! house, which has its expected finding, and no others.

use std::collections::BTreeSet;

use mateval_testkit::faulty_house::faults::{FAULTS, Fault, Place};

use super::*;

/// Marks of the three releases, and lists of replacements, of which the record holds the result already.
#[test]
fn the_marks_of_each_release_are_no_fault() {
    let replaced = json!({"replace_jid": "x", "replace_bbox": {"xLen": 100, "yLen": 50, "zLen": 1}, "componentModifiers": [],
        "components": [], "uv_override": {}, "material": "m", "parentJid": "p"});
    let expected = summary(&read_house(&small_house()).0.unwrap());
    for (place, change) in [
        ("", json!({"design_version": "0.1", "code_version": "0.11"})),
        ("", json!({"version": "2.0"})),
        ("", json!({"version": "2.0", "jobid": "j", "lights": [], "materialList": []})),
        ("", json!({"version": "2.0", "lights": [{}]})),
        ("/scene/room/0/children/0", replaced),
    ] {
        let mut json = small_house();
        json.pointer_mut(place).unwrap().as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
        let (house, findings) = read_house(&json);
        assert!(findings.is_empty(), "{findings:?}");
        assert_eq!(summary(&house.unwrap()), expected);
    }
}

#[test]
fn impossible_placements_are_reported() {
    for (key, value) in [("rot", json!("x")), ("pos", json!([1e30, 0, 0])), ("scale", json!([1, 2]))] {
        let mut json = small_house();
        json["scene"]["room"][0]["children"][0][key] = value;
        let (house, findings) = read_house(&json);
        assert_eq!(house.unwrap().rooms[0].children[0].placement.matrix(), glam::DMat4::IDENTITY);
        assert_eq!((findings.len(), findings[0].code.as_str()), (1, "bad_placement"), "{key}");
    }
}

/// The keys that some release lacks, by the list that holds them.
const OPTIONAL: [(&str, &str); 6] = [
    (
        "",
        "uid jobid version design_version code_version north_vector lights extension groups \
      materialList",
    ),
    ("/furniture", "aid category bbox size sourceCategoryId title type"),
    ("/mesh", "jid aid constructid instanceid lightBandIndex normal type"),
    (
        "/material",
        "aid texture normaltexture contentType seamWidth normalUVTransform uv_override \
      refPocketMaterial parentJid hsMaterialParameter modelComponent modelUid type",
    ),
    ("/scene", "ref pos rot scale boundingBox"),
    ("/scene/room", "size empty type pos rot scale"),
];

/// Removes the key from the object, or from each object of the list.
fn remove(json: &mut Value, holder: &str, key: &str) {
    let own = |value: &mut Value| value.as_object_mut().unwrap().remove(key);
    match json.pointer_mut(holder).unwrap() {
        Value::Array(all) => all.iter_mut().for_each(|one| drop(own(one))),
        one => drop(own(one)),
    }
}

/// A summary of a house: the children and triangles of its rooms.
fn summary(house: &House) -> (usize, usize, usize, Vec<Child>) {
    let triangles = house.meshes.iter().map(|mesh| mesh.mesh.triangles.len()).sum();
    let children = house.rooms.iter().flat_map(|room| room.children.clone()).collect();
    (house.furniture.len(), house.materials.len(), triangles, children)
}

/// None of these keys affects the content or its placement, and none of them is required.
#[test]
fn optional_keys_may_be_missing() {
    let whole = faulty_house::sound_json();
    let (house, findings) = read_house(&whole);
    assert!(findings.is_empty(), "{findings:?}");
    let expected = summary(&house.unwrap());
    assert_eq!(expected.3.len(), 75 + 34);
    let mut without_any = whole.clone();
    let mut seen = 0;
    for (holder, keys) in OPTIONAL {
        for key in keys.split(' ') {
            let mut json = whole.clone();
            remove(&mut json, holder, key);
            remove(&mut without_any, holder, key);
            let (house, findings) = read_house(&json);
            assert!(findings.is_empty(), "{holder} {key}: {findings:?}");
            assert_eq!(summary(&house.unwrap()), expected, "{holder} {key}");
            seen += 1;
        }
    }
    assert_eq!(seen, 48);
    let (house, findings) = read_house(&without_any);
    let house = house.unwrap();
    assert!(findings.is_empty(), "{findings:?}");
    assert_eq!((summary(&house), house.uid.as_str()), (expected, "stem"));
    assert!(house.rooms.iter().all(|room| room.kind == "OtherRoom"));
    assert!(house.meshes.iter().all(|mesh| mesh.kind == "Other"));
}

/// The twin: these keys matter, and their absence is reported.
#[test]
fn missing_keys_that_matter_are_reported() {
    let whole = faulty_house::sound_json();
    let expected = summary(&read_house(&whole).0.unwrap());
    let keys = [("/furniture", "uid"), ("/mesh", "uid"), ("/mesh", "xyz"), ("/mesh", "faces"), ("/mesh", "material")];
    let more = [("/mesh", "uv"), ("/material", "uid")];
    for (holder, key) in keys.into_iter().chain(more) {
        let mut json = whole.clone();
        remove(&mut json, holder, key);
        let (house, findings) = read_house(&json);
        assert!(!findings.is_empty(), "{holder} {key}");
        assert!(house.is_ok());
    }
    for (holder, key) in [("/furniture", "valid"), ("/material", "color"), ("/scene/room", "children")] {
        let mut json = whole.clone();
        remove(&mut json, holder, key);
        let house = read_house(&json).0.unwrap();
        let valid = house.furniture.iter().filter(|record| record.valid).count();
        let white =
            house.materials.iter().filter(|material| material.color.is_none_or(|color| color == [255.0; 3])).count();
        assert!(valid == 0 || white == 13 || summary(&house) != expected, "{holder} {key}");
    }
    let mut json = whole;
    json.as_object_mut().unwrap().remove("scene");
    assert!(read_house(&json).0.unwrap_err().to_string().contains("'scene'"));
}

/// The transforms of scene, room and child are all applied; computed by hand for the corner of a floor at (4, 0, 0).
#[test]
fn transforms_of_scene_and_room_are_applied() {
    let quarter = std::f64::consts::FRAC_1_SQRT_2;
    let mut json = small_house();
    json["scene"]["pos"] = json!([10, 0, 0]);
    json["scene"]["scale"] = json!([2, 2, 2]);
    let room = &mut json["scene"]["room"][0];
    // A quarter turn about y takes x to -z.
    room["rot"] = json!([0, quarter, 0, quarter]);
    room["pos"] = json!([0, 3, 0]);
    room["children"][0]["pos"] = json!([1, 0, 0]);
    let folder = tempfile::tempdir().unwrap();
    let house = furnish(&lone_house(folder.path(), json.to_string().as_bytes()), &Limits::default()).unwrap();
    assert_sound(&house);
    let matrix = house.house.rooms[0].house_from_room;
    assert!((matrix.transform_point3(DVec3::X * 5.0) - DVec3::new(10.0, 6.0, -10.0)).length() < 1e-9);
    let [low, high] = bounds(&house.scene.surfaces[0].mesh);
    // x of 1 to 5 becomes z of -2 to -10, z of 0 to 4 becomes x of 10 to 18.
    assert!((low - Vec3::new(10.0, 6.0, -10.0)).length() < 1e-5, "{low}");
    assert!((high - Vec3::new(18.0, 6.0, -2.0)).length() < 1e-5, "{high}");
    let [a, b, c] = house.scene.surfaces[0].mesh.corners(0);
    assert!((b - a).cross(c - a).y > 0.0);
}

/// Repeated ids of rooms become different, even where the new name is taken as well.
#[test]
fn rooms_have_unique_ids() {
    let room = |id: Value| json!({"type": "Bedroom", "instanceid": id, "children": []});
    let mut json = small_house();
    json["scene"]["room"] =
        json!([room(json!("a")), room(json!("a-2")), room(json!("a")), room(json!(null)), room(json!("Room-3"))]);
    let house = read_house(&json).0.unwrap();
    let ids: Vec<&str> = house.rooms.iter().map(|room| room.id.as_str()).collect();
    assert_eq!(ids, ["a", "a-2", "a-3", "Room-3", "Room-3-4"]);
}

/// The code of the expected finding, and where it is.
enum Expected {
    /// At the fault's pointer, or for its file.
    Here(&'static str),
    /// Elsewhere: the end of the file's path, and the place.
    There(&'static str, &'static str, &'static str),
    /// No finding; another test asserts the effect.
    Silent,
}

use Expected::{Here, Silent, There};

fn expected(name: &str) -> Expected {
    match name {
        "furniture_uid_repeated" | "material_uid_repeated" => Here("duplicate_uid"),
        "model_folder_missing" => There("missing_model", "-000000000928/raw_model.obj", ""),
        "valid_false" | "valid_missing" => There("not_public", ".json", "/furniture"),
        "material_normal_texture" => Here("normal_map"),
        "material_folder_missing" => There("missing_texture", "-000000000900/texture.png", ""),
        "mesh_normals_not_unit" | "mesh_normals_short" => Here("bad_normals"),
        "mesh_zero_area" => Here("zero_area"),
        "mesh_uv_null" => Here("bad_uv"),
        "mesh_material_dangles" => Here("no_material"),
        "mesh_index_out_of_range" => Here("bad_faces"),
        "mesh_without_faces" => There("empty_mesh", ".json", "/mesh/72"),
        "rotation_not_unit" => Here("rotation_not_unit"),
        "scale_mirrors" => Here("mirrored_piece"),
        "scale_tiny" => Here("scale_tiny"),
        "child_without_record" => Here("dangling_ref"),
        "model_not_listed" => There("unlisted_model", ".json", "/furniture/23"),
        "texture_truncated" => Here("unreadable_texture"),
        "texture_missing" => Here("missing_texture"),
        "model_shadow" => There("shadow_group", "16/raw_model.obj", "group 'Shadow_001'"),
        "model_drop_shadow" => Here("drop_shadow"),
        "model_centimetres" => Here("centimetres"),
        "category_chinese" | "category_missing" | "category_null" => Silent,
        "material_jid_local" | "material_jid_empty" | "material_texture_object" | "material_use_color" => Silent,
        "mesh_aid_text" | "mesh_type_empty" | "room_without_ceiling" | "scale_uneven" | "pieces_intersect" => Silent,
        "texture_alpha_zero" | "texture_grey_alpha" | "mtl_misleads" | "model_flat" => Silent,
        "obj_quads" | "obj_blanks" | "obj_three_uvs" | "obj_without_materials" => Silent,
        other => panic!("a fault that this table does not know: {other}"),
    }
}

/// The finding as `code`, the end of its file, its place.
fn wanted(fault: &Fault) -> Option<[String; 3]> {
    let (file, place) = match fault.place {
        Place::Json { pointer } => (".json", pointer),
        Place::File { path } => (path, ""),
    };
    match expected(fault.name) {
        Here(code) => Some([code, file, place].map(str::to_owned)),
        There(code, file, place) => Some([code, file, place].map(str::to_owned)),
        Silent => None,
    }
}

#[test]
fn every_fault_is_reported_and_nothing_else() {
    let house = furnished();
    let mut reported = BTreeSet::new();
    for fault in &FAULTS {
        let Some([code, file, place]) = wanted(fault) else { continue };
        let is_it = |(_, finding): &(usize, &mateval_dataset::Finding)| {
            finding.code == code && finding.file.ends_with(&file) && finding.place == place
        };
        let found: Vec<usize> = house.findings.iter().enumerate().filter(is_it).map(|(at, _)| at).collect();
        assert_eq!(found.len(), 1, "{}: {code} {file} {place}", fault.name);
        reported.extend(found);
    }
    assert!(reported.len() > 20);
    let others: Vec<_> =
        (0..house.findings.len()).filter(|at| !reported.contains(at)).map(|at| &house.findings[at]).collect();
    // The model that is missing from the list is placed twice: two records, one finding each. The piece without a
    // folder is one of three models whose folder is missing, but the other two are not valid. Thresholds intersect
    // floors, as in real houses, and what stands on a floor touches it.
    let others: Vec<String> = others.iter().map(|f| format!("{} {}", f.code, f.place)).collect();
    assert_eq!(
        others,
        ["coincident_sheets /mesh", "furniture_in_architecture /furniture", "unlisted_model /furniture/24"]
    );
}

/// Faults without a finding have an effect: the piece exists and has the category of the list of models and its own
/// colours.
#[test]
fn silent_faults_have_their_effect() {
    let house = furnished();
    let origin = |number: u32| {
        let of = |placed: &&PlacedSurface| placed.model.as_ref().is_some_and(|model| model.jid == jid(number));
        let placed = house.placed.iter().rfind(of).unwrap();
        let PlacedModel { name, complete, .. } = placed.model.as_ref().unwrap();
        let [category, super_category] = [&placed.origin.category, &placed.origin.super_category];
        let text = |text: &Option<String>| text.clone().unwrap_or_default();
        (text(super_category), text(category), name.clone(), *complete)
    };
    // Chinese in the house, English in the list.
    let chest = origin(15);
    assert_eq!((chest.0.as_str(), chest.3), ("Cabinet/Shelf/Desk", false));
    assert_eq!(chest.2, chest.1.to_lowercase());
    assert!(chest.1.starts_with("Drawer Chest"), "{}", chest.1);
    // Null as category: the list has none either, so the title decides.
    let picture = origin(8);
    assert_eq!((picture.0.as_str(), picture.1.as_str(), picture.3), ("Others", "picture", true));
    // Pictures without opacity, and grey ones with opacity, are read.
    assert!(origin(14).3 && origin(19).3);
    // Neither in the list nor with a picture of its own.
    let crate_box = origin(21);
    assert_eq!((crate_box.0.as_str(), crate_box.3), ("Others", false));
    // Of two pieces that intersect, both are kept.
    assert_eq!(pieces_of(house, LIBRARY, 21).len(), 2);
    assert!(house.placed.iter().any(|p| p.room == LIBRARY && is_kind(p, "Other")));
    let ceilings = house.placed.iter().filter(|p| is_kind(p, "Ceiling"));
    assert_eq!(ceilings.map(|p| p.room).collect::<Vec<_>>(), [0, 1]);
}

/// The twin: the same house without faults has no warning.
#[test]
fn a_sound_house_has_no_warning() {
    let disk = Disk::new();
    for number in [15, 21] {
        std::fs::copy(disk.model(1).join("texture.png"), disk.model(number).join("texture.png")).unwrap();
    }
    let house = disk.furnish_json(&faulty_house::sound_json()).unwrap();
    assert_eq!(warnings(&house), [""; 0]);
    assert_sound(&house);
    let codes: BTreeSet<&str> = house.findings.iter().map(|finding| finding.code.as_str()).collect();
    // Findings about the models' own files and about models that are not public remain, and every real house has
    // coincident sheets, and furniture that touches the floor.
    let of_models = ["centimetres", "drop_shadow", "shadow_group", "unlisted_model"];
    let of_houses = ["coincident_sheets", "furniture_in_architecture", "not_public"];
    assert_eq!(codes, of_models.into_iter().chain(of_houses).collect());
    // The twin of this: the house with its faults has warnings.
    assert!(warnings(furnished()).len() > 5);
}
