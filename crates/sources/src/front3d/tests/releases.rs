//! The three releases of the data, and every key that one of them lacks.

use glam::DVec3;

use super::*;

fn release_of(change: Value) -> Release {
    let mut json = small_house();
    json.as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
    let (house, findings) = read_house(&json);
    assert!(findings.is_empty(), "{findings:?}");
    house.unwrap().release
}

#[test]
fn releases_are_recognised() {
    assert_eq!(release_of(json!({"design_version": "0.1", "code_version": "0.11"})), Release::R1);
    assert_eq!(release_of(json!({"version": "2.0"})), Release::R2);
    assert_eq!(release_of(json!({"version": "2.0", "jobid": "j", "lights": [], "materialList": []})), Release::R3);
    assert_eq!(release_of(json!({"version": "2.0", "lights": [{}]})), Release::R3);
}

/// The keys that some release lacks, by the list that holds them.
const OPTIONAL: [(&str, &[&str]); 6] = [
    (
        "",
        &[
            "uid",
            "jobid",
            "version",
            "design_version",
            "code_version",
            "north_vector",
            "lights",
            "extension",
            "groups",
            "materialList",
        ],
    ),
    ("/furniture", &["aid", "category", "bbox", "size", "sourceCategoryId", "title", "type"]),
    ("/mesh", &["jid", "aid", "constructid", "instanceid", "lightBandIndex", "normal", "type"]),
    (
        "/material",
        &[
            "aid",
            "texture",
            "normaltexture",
            "contentType",
            "seamWidth",
            "normalUVTransform",
            "uv_override",
            "refPocketMaterial",
            "parentJid",
            "hsMaterialParameter",
            "modelComponent",
            "modelUid",
            "type",
        ],
    ),
    ("/scene", &["ref", "pos", "rot", "scale", "boundingBox"]),
    ("/scene/room", &["size", "empty", "type", "pos", "rot", "scale"]),
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
        for key in keys {
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
    assert_eq!((summary(&house), house.release, house.uid.as_str()), (expected, Release::R1, "stem"));
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
    assert!(matches!(read_house(&json).0, Err(HouseError::NoScene)));
}

/// The record already holds the jid of a replaced model.
#[test]
fn lists_of_replacements_are_ignored() {
    let mut json = faulty_house::sound_json();
    let expected = summary(&read_house(&json).0.unwrap());
    let more = json!({"replace_jid": "x", "replace_bbox": {"xLen": 100, "yLen": 50, "zLen": 1}, "componentModifiers": [],
        "components": [], "uv_override": {}, "material": "m", "parentJid": "p"});
    for room in json["scene"]["room"].as_array_mut().unwrap() {
        for child in room["children"].as_array_mut().unwrap() {
            child.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        }
    }
    let (house, findings) = read_house(&json);
    assert!(findings.is_empty(), "{findings:?}");
    assert_eq!(summary(&house.unwrap()), expected);
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
