//! `prep stats`: its output for the sample, its numbers against `scene.json`, and the inputs that it refuses.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::command::{Run, run, stats};
use super::planted::{Room, edit_json, rehash};
use super::sample::{copied_dataset, dataset, files_below, json};

#[track_caller]
fn gives(command: &mut Command, code: i32, stdout: &str, stderr: &str) {
    let expected = Run { code: Some(code), stdout: stdout.to_owned(), stderr: stderr.to_owned() };
    let found = run(command);
    assert_eq!(found, expected, "stdout:\n{}\nstderr:\n{}", found.stdout, found.stderr);
}

/// Super-categories and categories for the room's first instances, as in a furnished source.
const FURNITURE: [(&str, Option<&str>); 5] = [
    ("Sofa", Some("Three-Seat / Multi-seat Sofa")),
    ("Chair", Some("Dining Chair")),
    ("Chair", Some("Dining Chair")),
    ("Chair", None),
    ("Lamp <new>", Some("Desk & Wall")),
];

/// A copy of the sample whose first instances are furniture.
fn furnished() -> tempfile::TempDir {
    let copy = copied_dataset();
    Room::of(copy.path()).edit_scene(|scene| {
        for (at, (super_category, category)) in FURNITURE.iter().enumerate() {
            scene["instances"][at]["role"] = serde_json::json!({ "type": "furniture" });
            scene["instances"][at]["super_category"] = Value::from(*super_category);
            scene["instances"][at]["category"] = Value::from(*category);
        }
    });
    rehash(copy.path());
    copy
}

/// The sample's source states no roles: the tables show that nothing is known of its objects.
#[test]
fn the_sample_as_tables() {
    gives(&mut stats(dataset()), 0, SAMPLE_TEXT, "");
}

const SAMPLE_TEXT: &str = "\
Table I of the paper, for sample 0.1.0
                                  min  max  scenes
  Number of scenes             1
  Avg. Objects/Scene     unknown
  Avg. Categories/Scene  unknown

Further counts
                                 min  max  scenes
  houses                      1
  scenes of bitterli          1
  instances                  24
    with an atlas            23
    objects                   0
    architecture              0
    others                   24
  different categories        0
    avg. per scene      unknown

True albedo of 1 input view
                      mean  deviation
  luminance          0.308      0.280
  lightness (Oklab)  0.604      0.216
  chroma (Oklab)     0.043      0.026
  local contrast     0.045      0.036
  fine share         0.584      0.000

Objects by super-category
  super-category      objects  share
  Cabinet/Shelf/Desk        0   none
  Sofa                      0   none
  Lighting                  0   none
  Chair                     0   none
  Others                    0   none
  Bed                       0   none
  Table                     0   none
  Pier/Stool                0   none

Objects by category
  none

Findings about the sources
  severity  code               findings
  note      coincident_sheets         1

Scenes
  scene  source    house   objects  super-categories  categories  architecture  others  atlases  errors  warnings  notes
  room   bitterli  sample        ?                 ?           ?             0      24       23       0         0      1

Objects by scene and super-category
  scene  cabinet  sofa  lighting  chair  others  bed  table  stool
  room         ?     ?         ?      ?       ?    ?      ?      ?
";

#[test]
fn furniture_as_tables() {
    let copy = furnished();
    gives(&mut stats(copy.path()), 0, FURNISHED_TEXT, "");
}

const FURNISHED_TEXT: &str = "\
Table I of the paper, for sample 0.1.0
                              min  max  scenes
  Number of scenes         1
  Avg. Objects/Scene     5.0    5    5       1
  Avg. Categories/Scene  3.0    3    3       1

Further counts
                             min  max  scenes
  houses                  1
  scenes of bitterli      1
  instances              24
    with an atlas        23
    objects               5
    architecture          0
    others               19
  different categories    3
    avg. per scene      3.0    3    3       1

True albedo of 1 input view
                      mean  deviation
  luminance          0.308      0.280
  lightness (Oklab)  0.604      0.216
  chroma (Oklab)     0.043      0.026
  local contrast     0.045      0.036
  fine share         0.584      0.000

Objects by super-category
  super-category                 objects   share
  Cabinet/Shelf/Desk                   0   0.0 %
  Sofa                                 1  20.0 %
  Lighting                             0   0.0 %
  Chair                                3  60.0 %
  Others                               0   0.0 %
  Bed                                  0   0.0 %
  Table                                0   0.0 %
  Pier/Stool                           0   0.0 %
  Lamp <new> (not of the eight)        1  20.0 %

Objects by category
  super-category  category                      objects
  Sofa            Three-Seat / Multi-seat Sofa        1
  Chair           Dining Chair                        2
  Chair           (none)                              1
  Lamp <new>      Desk & Wall                         1

Findings about the sources
  severity  code               findings
  note      coincident_sheets         1

Scenes
  scene  source    house   objects  super-categories  categories  architecture  others  atlases  errors  warnings  notes
  room   bitterli  sample        5                 3           3             0      19       23       0         0      1

Objects by scene and super-category
  scene  cabinet  sofa  lighting  chair  others  bed  table  stool  not of the eight
  room         0     1         0      3       0    0      0      0                 1
";

/// Counts the instances of `scene.json` without the program's types.
fn by_hand(scene: &Value) -> (usize, usize, usize) {
    let instances = scene["instances"].as_array().unwrap();
    let objects = instances.iter().filter(|instance| instance["role"]["type"] == "furniture").count();
    let with_atlas = instances.iter().filter(|instance| !instance["atlas"].is_null()).count();
    (instances.len(), objects, with_atlas)
}

#[test]
fn the_json_is_exact_and_matches_its_schema() {
    let copy = furnished();
    let printed = run(stats(copy.path()).args(["--format", "json"])).ends_with(0);
    assert_eq!(printed.stderr, "");
    let found: Value = serde_json::from_str(&printed.stdout).unwrap();
    let schema = json(&Path::new(env!("CARGO_MANIFEST_DIR")).join("dataset_spec/schema/stats.schema.json"));
    let validator = jsonschema::validator_for(&schema).unwrap();
    assert!(validator.is_valid(&found), "{}", printed.stdout);
    let number = |value: &Value| value.as_u64().unwrap() as usize;
    let counts = |value: &Value| {
        (number(&value["instances"]), number(&value["objects"]), number(&value["instances_with_atlas"]))
    };
    let expected = by_hand(&json(&copy.path().join("scenes/room/scene.json")));
    assert_eq!([&found["total"], &found["per_scene"][0]["counts"]].map(counts), [expected; 2]);
    assert_eq!(found["objects_per_scene"], serde_json::json!({ "scenes": 1, "mean": 5.0, "min": 5, "max": 5 }));
    assert_eq!(
        found["total"]["super_categories"][3],
        serde_json::json!({ "super_category": "Chair", "objects": 3, "share": 0.6 })
    );
    assert_eq!(found["dataset"]["manifest_sha256"], json(&copy.path().join("dataset.json"))["manifest_sha256"]);
    // The twin: an unknown word.
    let mut unknown = found;
    unknown["total"]["chairs"] = Value::from(3);
    assert!(!validator.is_valid(&unknown));
}

#[test]
fn the_picture_is_written_and_always_the_same() {
    let (copy, out) = (furnished(), tempfile::tempdir().unwrap());
    let draw = |name: &str| {
        let path = out.path().join(name);
        let drawn = run(stats(copy.path()).arg("--picture").arg(&path)).ends_with(0);
        assert!(drawn.stdout.ends_with(&format!("\n\n{}\n", path.display())), "{}", drawn.stdout);
        std::fs::read_to_string(path).unwrap()
    };
    let svg = draw("a.svg");
    assert!(
        svg.contains(">Three-Seat &#x2f; Multi-seat Sofa</text>") && svg.contains(">Desk &amp; Wall</text>"),
        "{svg}"
    );
    assert!(svg.contains("prefers-color-scheme: dark") && !svg.contains("<new>"), "{svg}");
    assert_eq!(draw("b.svg"), svg);
    // With JSON, stdout holds nothing else.
    let path = out.path().join("c.svg");
    let printed = run(stats(copy.path()).args(["--format", "json", "--picture"]).arg(&path)).ends_with(0);
    assert!(serde_json::from_str::<Value>(&printed.stdout).is_ok() && path.is_file(), "{}", printed.stdout);
}

/// A dataset beside itself has distance zero, in the table and exactly in the JSON. A look cannot be compared where the
/// ground truth is withheld.
#[test]
fn a_dataset_beside_itself() {
    let beside = |original: &Path| {
        let mut command = stats(dataset());
        command.arg("--beside").arg(original);
        command
    };
    run(&mut beside(dataset()))
        .ends_with(0)
        .prints("True albedo of 1 input view, beside 1 of sample 0.1.0\n")
        .prints("                      mean  original  deviation  original  distance\n")
        .prints("  luminance          0.308     0.308      0.280     0.280     0.000\n");
    let printed = run(beside(dataset()).args(["--format", "json"])).ends_with(0);
    let found: Value = serde_json::from_str(&printed.stdout).unwrap();
    let schema = json(&Path::new(env!("CARGO_MANIFEST_DIR")).join("dataset_spec/schema/stats.schema.json"));
    assert!(jsonschema::validator_for(&schema).unwrap().is_valid(&found), "{}", printed.stdout);
    for quantity in ["luminance", "lightness", "chroma", "local_contrast", "fine_share"] {
        assert_eq!(found["beside"]["distance"][quantity], 0.0, "{quantity}");
        assert_eq!(found["beside"]["look"][quantity], found["look"][quantity]);
    }
    let out = tempfile::tempdir().unwrap();
    let path = out.path().join("look.svg");
    run(beside(dataset()).arg("--picture").arg(&path)).ends_with(0);
    assert!(std::fs::read_to_string(&path).unwrap().contains(">sample 0.1.0 (original)</text>"));
    run(beside(dataset()).arg("--findings")).ends_with(2).says("--findings");
    let copy = copied_dataset();
    std::fs::remove_dir_all(copy.path().join("scenes/room/ground_truth/views")).unwrap();
    run(&mut beside(copy.path())).ends_with(2).says("its ground truth is withheld");
}

/// A picture replaces a file only with --force and never lies in the dataset, which would become unsound.
#[test]
fn places_that_a_picture_must_not_have() {
    let (copy, out) = (copied_dataset(), tempfile::tempdir().unwrap());
    let mine = out.path().join("mine.svg");
    std::fs::write(&mine, "mine").unwrap();
    let before = files_below(copy.path());
    let cases = [
        (mine.clone(), "already exists; choose another --picture, or add --force to overwrite it"),
        (out.path().to_owned(), "is a folder; expected the name of a picture file"),
        (out.path().join("no/a.svg"), "does not exist; make it, or choose another --picture"),
        (copy.path().join("a.svg"), "whose manifest does not list it; choose another --picture"),
        (copy.path().join("scenes/room/a.svg"), "would lie in the dataset"),
    ];
    for (place, why) in &cases {
        let refused = run(stats(copy.path()).arg("--picture").arg(place)).ends_with(2).says(why);
        assert!(refused.stdout.is_empty() && refused.stderr.contains(&format!("'{}'", place.display())), "{refused:?}");
    }
    let scene = copy.path().join("scenes/room/scene.json");
    run(stats(copy.path()).args(["--force", "--picture"]).arg(&scene)).ends_with(2).says("would lie in the dataset");
    assert_eq!(files_below(copy.path()), before);
    assert_eq!(std::fs::read_to_string(&mine).unwrap(), "mine");
    // The twin: an allowed place, and a file that may be replaced.
    run(stats(copy.path()).args(["--force", "--picture"]).arg(&mine)).ends_with(0);
    assert!(std::fs::read_to_string(&mine).unwrap().starts_with("<svg"));
    run(stats(copy.path()).arg("--force")).ends_with(2).says("--picture <FILE.svg>");
}

/// Hostile JSON with matching hashes: exit code 2 and the file's name, and no crash.
#[test]
fn hostile_json() {
    let hostile: [fn(&mut Value); 9] = [
        |scene| *scene = Value::Null,
        |scene| scene["instances"] = Value::from("all of them"),
        |scene| scene["instances"][0]["super_category"] = Value::from(7),
        |scene| scene["instances"][0]["role"] = serde_json::json!({ "type": "ghost" }),
        |scene| scene["source"]["kind"] = Value::from("elsewhere"),
        |scene| scene["lights"] = Value::from("none"),
        |scene| scene["instances"][0]["index"] = Value::from(0),
        |scene| scene["instances"][0]["triangles"] = Value::from(-1),
        |scene| scene["findings"] = serde_json::json!([{ "severity": "fatal" }]),
    ];
    for change in hostile {
        let copy = copied_dataset();
        Room::of(copy.path()).edit_scene(change);
        rehash(copy.path());
        let refused = run(&mut stats(copy.path())).ends_with(2);
        assert!(refused.error().contains("scene.json") && refused.stdout.is_empty(), "{}", refused.stderr);
        assert!(!refused.stderr.contains("panicked"), "{}", refused.stderr);
    }
    for text in ["", "{", "\u{0}", &"[".repeat(100_000)] {
        let copy = copied_dataset();
        std::fs::write(copy.path().join("scenes/room/scene.json"), text).unwrap();
        rehash(copy.path());
        run(&mut stats(copy.path())).ends_with(2).says("[bad_json]").says("scene.json");
    }
}

/// Faults of several files are reported together.
#[test]
fn every_fault_at_once() {
    let copy = copied_dataset();
    Room::of(copy.path()).edit_scene(|scene| scene["format"] = Value::from("mateval/0"));
    edit_json(&copy.path().join("targets.json"), |targets| targets["targets"] = Value::from(3));
    edit_json(&copy.path().join("dataset.json"), |file| file["scenes"] = serde_json::json!(["room", "attic"]));
    rehash(copy.path());
    let refused = run(&mut stats(copy.path())).ends_with(2);
    for fault in [
        "[bad_json] 'targets.json' /targets: ",
        "[unreadable] 'scenes/room/scene.json': ",
        "'scenes/attic/scene.json': ",
    ] {
        assert!(refused.stderr.contains(fault), "'{fault}' not in {}", refused.stderr);
    }
    // A file counts as changed if its hash was not renewed.
    let copy = copied_dataset();
    Room::of(copy.path()).edit_scene(|scene| scene["instances"][0]["category"] = Value::from("Sofa"));
    run(&mut stats(copy.path())).ends_with(2).says("changed_file");
    // A scene that is listed twice would be counted twice.
    edit_json(&copy.path().join("dataset.json"), |file| file["scenes"] = serde_json::json!(["room", "room"]));
    rehash(copy.path());
    run(&mut stats(copy.path())).ends_with(2).says("[duplicate_id] 'dataset.json' /scenes/1: 'room' is listed twice");
}
