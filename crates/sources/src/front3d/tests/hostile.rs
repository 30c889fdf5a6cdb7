//! Untrusted files: for any content, the result is an error with a message or a sound house.

use proptest::prelude::*;
use proptest::sample::select;

use super::*;

/// Keys of the format.
const KEYS: &str = "uid jid version lights materialList furniture mesh material scene room children pos rot scale xyz \
    normal uv faces type ref instanceid valid category title color UVTransform useColor colorMode \
    extension snapshots target fov";
const TEXTS: [&str; 12] =
    ["", "f", "m", "local", "mesh/1", "furniture/1", "../x", "Floor", "Ceiling", "植物", "\0", "a/b"];

fn key() -> impl Strategy<Value = &'static str> {
    select(KEYS.split(' ').collect::<Vec<_>>())
}

fn leaf() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        (-2_i64..8).prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<f64>().prop_map(|number| json!(number)),
        select(&TEXTS[..]).prop_map(Value::from),
        Just("x".repeat(5000).into()),
        Just(json!([0, 0, 0, 1])),
        Just(json!([1e300, -1e300, 1])),
    ]
}

fn any_json() -> impl Strategy<Value = Value> {
    leaf().prop_recursive(5, 48, 6, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..6).prop_map(Value::Array),
            prop::collection::vec((key(), inner), 0..8)
                .prop_map(|pairs| pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()),
        ]
    })
}

/// A path into a tree, and the value that is put there.
fn any_mutation() -> impl Strategy<Value = (Vec<usize>, Value)> {
    let value = prop_oneof![
        2 => select(vec![json!(null), json!("text"), json!(1e300), json!(-1), json!(-7.5), json!([]), json!({})]),
        2 => select(vec![json!(1e5), json!(99_999), json!(0), json!(1e-30), json!([1e4, 1e4, 1e4]), json!([0, 0, 0])]),
        1 => any_json(),
    ];
    (prop::collection::vec(any::<usize>(), 1..7), value)
}

fn mutate(json: &mut Value, way: &[usize], value: Value) {
    let mut place = json;
    for step in way {
        let empty = match place {
            Value::Array(all) => all.is_empty(),
            Value::Object(all) => all.is_empty(),
            _ => true,
        };
        if empty {
            break;
        }
        place = match place {
            Value::Array(all) => {
                let at = step % all.len();
                &mut all[at]
            }
            Value::Object(all) => {
                let at = step % all.len();
                all.values_mut().nth(at).unwrap()
            }
            _ => unreachable!("a leaf ends the way"),
        };
    }
    *place = value;
}

fn assert_house_is_sound(json: &Value) {
    if !json.is_object() {
        return;
    }
    let (house, findings) = read_house(json);
    let Ok(house) = house else { return };
    for mesh in &house.meshes {
        assert!(!mesh.mesh.triangles.is_empty());
        assert!(mesh.mesh.positions.iter().all(|p| p.is_finite()));
        assert!(mesh.mesh.triangles.iter().flatten().all(|v| (*v as usize) < mesh.mesh.positions.len()));
        assert!(mesh.material.is_none_or(|at| at < house.materials.len()));
    }
    for child in house.rooms.iter().flat_map(|room| &room.children) {
        assert!(child.placement.matrix().is_finite());
        assert!((child.placement.rotation.length() - 1.0).abs() < 1e-9);
        match child.what {
            ChildKind::Furniture(at) => assert!(at < house.furniture.len()),
            ChildKind::Mesh(at) => assert!(at < house.meshes.len()),
        }
    }
    assert!(findings.iter().all(|finding| finding.message.len() < 1000));
}

fn faulty_json() -> &'static Value {
    static JSON: OnceLock<Value> = OnceLock::new();
    JSON.get_or_init(faulty_house::json)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_json_is_an_error_or_a_sound_house(
        keys in prop::collection::vec((key(), any_json()), 0..8),
        room in any_json(),
    ) {
        let mut json: Value = keys.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        assert_house_is_sound(&json);
        json["scene"] = json!({"room": [room]});
        assert_house_is_sound(&json);
    }

    #[test]
    fn a_mutated_small_house_is_an_error_or_sound(changes in prop::collection::vec(any_mutation(), 1..5)) {
        let mut json = small_house();
        changes.into_iter().for_each(|(way, value)| mutate(&mut json, &way, value));
        assert_house_is_sound(&json);
    }

    #[test]
    fn a_mutated_whole_house_is_an_error_or_sound((way, value) in any_mutation()) {
        let mut json = faulty_json().clone();
        mutate(&mut json, &way, value);
        assert_house_is_sound(&json);
    }
}

/// The house is also furnished, and rays are traced in it.
#[test]
fn mutated_houses_are_furnished_or_refused() {
    let disk = Disk::bare();
    // Half of all changes concern the content of rooms.
    let in_rooms = (prop::collection::vec(any::<usize>(), 3..6), any_mutation().prop_map(|(_, value)| value));
    let strategy = prop::collection::vec(prop_oneof![any_mutation(), in_rooms], 1..4);
    let config = ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() };
    let furnished = std::cell::Cell::new(0);
    let rng = proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha);
    let furnish_mutated = |changes: Vec<(Vec<usize>, Value)>| {
        let mut json = disk.json.clone();
        for (place, (way, value)) in changes.into_iter().enumerate() {
            let from = if place % 2 == 0 { &mut json } else { &mut json["scene"] };
            mutate(from, &way, value);
        }
        if let Ok(house) = disk.furnish_json(&json) {
            assert_sound(&house);
            let _ = mateval_tracer::World::new(house.scene);
            furnished.set(furnished.get() + 1);
        }
        Ok(())
    };
    proptest::test_runner::TestRunner::new_with_rng(config, rng).run(&strategy, furnish_mutated).unwrap();
    let furnished = furnished.get();
    assert!(furnished > 10, "{furnished}");
}

/// Transforms that are each valid, but together lead beyond all limits.
#[test]
fn pieces_that_are_too_far_away_are_left_out() {
    let disk = Disk::bare();
    let mut json = disk.json.clone();
    json["scene"]["scale"] = json!([99_999, 99_999, 99_999]);
    json["scene"]["room"][0]["scale"] = json!([99_999, 99_999, 99_999]);
    let house = disk.furnish_json(&json).unwrap();
    assert_sound(&house);
    assert!(house.placed.iter().all(|placed| placed.room != LIVING));
    assert!(house.findings.iter().any(|f| f.code == "bad_placement" && f.place.starts_with("/scene/room/0/children/")));
    // Twin: each of them alone is valid.
    json["scene"]["scale"] = json!([1, 1, 1]);
    assert!(disk.furnish_json(&json).unwrap().placed.iter().any(|placed| placed.room == LIVING));
}

fn refusal(files: &HouseFiles) -> String {
    furnish(files, &Limits::default()).unwrap_err().to_string()
}

/// A file of 200 MB, which is refused by its size without being read.
#[test]
fn huge_files_are_refused_by_their_size() {
    let folder = tempfile::tempdir().unwrap();
    let files = lone_house(folder.path(), b"[[[[");
    let file = std::fs::OpenOptions::new().write(true).open(folder.path().join("h.json")).unwrap();
    file.set_len(200_000_000).unwrap();
    let found = refusal(&files);
    assert!(found.contains("h.json") && found.contains("found 200000000"), "{found}");
}

#[test]
fn deep_and_broken_files_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let deep = "[".repeat(1_000_000);
    for (text, expected) in [
        (deep.as_bytes(), "expected JSON"),
        (b"", "expected JSON"),
        (b"\xff\xfe{", "expected JSON"),
        (b"{}", "scene"),
        (b"{\"scene\": 7}", "scene"),
        (b"[]", "found a list"),
    ] {
        let found = refusal(&lone_house(folder.path(), text));
        assert!(found.contains(expected) && found.contains("h.json"), "{found}");
    }
    let missing = HouseFiles { house: "none.json".into(), ..lone_house(folder.path(), b"{}") };
    assert!(refusal(&missing).contains("none.json"));
    let is_folder = HouseFiles { house: "models".into(), ..lone_house(folder.path(), b"{}") };
    assert!(refusal(&is_folder).contains("models"));
    // Twin: the small house can be read.
    let files = lone_house(folder.path(), small_house().to_string().as_bytes());
    assert_eq!(furnish(&files, &Limits::default()).unwrap().scene.surfaces.len(), 1);
}

/// Every limit on counts refuses a house that exceeds it.
#[test]
fn limits_hold() {
    let (whole, bare_disk, all) = (Disk::new(), Disk::bare(), Limits::default());
    let with = |limits: Limits| furnish(&bare_disk.files(), &limits);
    for (limits, expected) in [
        (Limits { rooms: 2, ..all }, "at most 2 rooms"),
        (Limits { children: 50, ..all }, "at most 50 children"),
        (Limits { json_bytes: 1000, ..all }, "at most 1000 bytes"),
        (Limits { json_values: 1000, ..all }, "at most 1000 values"),
        (Limits { triangles: 100, ..all }, "at most 100 triangles"),
    ] {
        let error = with(limits).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    // Sufficient for the architecture and for some of the models.
    let architecture: usize = bare().house.meshes.iter().map(|mesh| mesh.mesh.triangles.len()).sum();
    let tight = with(Limits { triangles: architecture + 3000, ..all }).unwrap();
    assert_sound(&tight);
    assert!(tight.scene.surfaces.iter().map(|s| s.mesh.triangles.len()).sum::<usize>() <= architecture + 3000);
    assert!(tight.findings.iter().any(|f| f.code == "limit"));
    let texels = furnish(&whole.files(), &Limits { texels: 256 * 256, ..all }).unwrap();
    assert!(texels.scene.textures.len() <= 1 && texels.findings.iter().any(|f| f.code == "limit"));
    assert_sound(&texels);
    let small_files = furnish(&whole.files(), &Limits { file_bytes: 10_000, ..all }).unwrap();
    assert_sound(&small_files);
    assert!(small_files.findings.iter().any(|f| f.code == "limit"));
    assert_eq!(with(Limits { findings: 5, ..all }).unwrap().findings.len(), 6);
}
