//! Checks the documents against the program: the schemas, examples and worked numbers of `dataset_spec/`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use mateval_baselines::adapter::Adapter;
use mateval_baselines::delight::FittedLightsFile;
use mateval_baselines::encoding_report::EncodingReport;
use mateval_baselines::import::{FlatMaterials, ImportReport};
use mateval_dataset::dataset::{DatasetFile, SceneFile, TargetsFile};
use mateval_dataset::material::MaterialClassesFile;
use mateval_dataset::measured::{MeasuredFile, MeasurementsFile};
use mateval_dataset::reference::{LightsFile, ReferenceFile, SourceMaterialsFile};
use mateval_dataset::render_file::{RenderFile, ScorerFile};
use mateval_dataset::submission::SubmissionFile;
use mateval_dataset::verdict::VerdictFile;
use mateval_eval::result::ResultFile;
use mateval_eval::verify::VerificationFile;
use mateval_prep::blender_job::{BlenderJob, BlenderResult};
use mateval_prep::compare::file::CompareFile;
use mateval_prep::recipe::Recipe;
use mateval_prep::stats::StatsFile;
use mateval_prep::stats::findings::FindingsFile;
use mateval_prep::survey::SurveyFile;
use mateval_prep::survey::rules::SelectionRules;
use mateval_report::explain::file::ExplainFile;
use mateval_report::leaderboard::entries::ErrataFile;
use mateval_report::leaderboard::file::LeaderboardFile;
use mateval_report::release::ReleaseFile;
use mateval_report::rounded::RoundedFile;
use mateval_report::votes::{Preferences, VotesFile};
use mateval_submission::lint::LintFile;
use schemars::transform::{RecursiveTransform, Transform};
use schemars::{Schema, schema_for};
use serde_json::{Value, json};

/// The command that updates the schemas.
const FIX: &str = "MATEVAL_WRITE_SCHEMAS=1 cargo test --test suite schemas_are_those_of_the_types";

fn spec(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("dataset_spec").join(path)
}

/// Every file of a folder, by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap())).collect()
}

/// The JSON Schema of every kind of JSON and TOML file, made from the Rust type that reads and writes it.
fn schemas() -> [(&'static str, Schema); 36] {
    [
        ("recipe", of_toml(schema_for!(Recipe))),
        ("survey_rules", of_toml(schema_for!(SelectionRules))),
        ("adapter", of_toml(schema_for!(Adapter))),
        ("dataset", schema_for!(DatasetFile)),
        ("targets", schema_for!(TargetsFile)),
        ("scene", schema_for!(SceneFile)),
        ("reference", schema_for!(ReferenceFile)),
        ("source_materials", schema_for!(SourceMaterialsFile)),
        ("lights", schema_for!(LightsFile)),
        ("material_classes", schema_for!(MaterialClassesFile)),
        ("measured", schema_for!(MeasuredFile)),
        ("measurements", schema_for!(MeasurementsFile)),
        ("render", schema_for!(RenderFile)),
        ("submission", schema_for!(SubmissionFile)),
        ("scorer", schema_for!(ScorerFile)),
        ("result", schema_for!(ResultFile)),
        ("explain", schema_for!(ExplainFile)),
        ("rounded", schema_for!(RoundedFile)),
        ("verification", schema_for!(VerificationFile)),
        ("lint", schema_for!(LintFile)),
        ("leaderboard", schema_for!(LeaderboardFile)),
        ("errata", schema_for!(ErrataFile)),
        ("votes", schema_for!(VotesFile)),
        ("preferences", schema_for!(Preferences)),
        ("stats", schema_for!(StatsFile)),
        ("findings", schema_for!(FindingsFile)),
        ("release", schema_for!(ReleaseFile)),
        ("survey", schema_for!(SurveyFile)),
        ("blender_job", schema_for!(BlenderJob)),
        ("blender_result", schema_for!(BlenderResult)),
        ("compare", schema_for!(CompareFile)),
        ("compare_verdict", schema_for!(VerdictFile)),
        ("encoding", schema_for!(EncodingReport)),
        ("fitted_lights", schema_for!(FittedLightsFile<'static>)),
        ("import", schema_for!(ImportReport)),
        ("import_materials", schema_for!(FlatMaterials)),
    ]
}

/// The schema of a TOML file: without null, which TOML does not have.
fn of_toml(mut schema: Schema) -> Schema {
    RecursiveTransform(without_null).transform(&mut schema);
    schema
}

fn without_null(schema: &mut Schema) {
    for (key, null) in [("type", json!("null")), ("anyOf", json!({ "type": "null" }))] {
        let Some(Value::Array(options)) = schema.get_mut(key) else { continue };
        options.retain(|option| *option != null);
        let [only] = &options[..] else { continue };
        match only.clone() {
            // The keys of the only object stand beside those of `anyOf`, such as its description.
            Value::Object(inner) => {
                schema.remove(key);
                schema.ensure_object().extend(inner);
            }
            only => {
                schema.insert(key.to_owned(), only);
            }
        }
    }
}

/// The schemas as files, by name.
fn made() -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    for (name, schema) in schemas() {
        mateval_dataset::json::write(&folder.path().join(format!("{name}.schema.json")), &schema).unwrap();
    }
    files(folder.path())
}

/// A line for every file whose bytes differ.
fn differences(made: &BTreeMap<String, Vec<u8>>, kept: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    let names: BTreeSet<&String> = made.keys().chain(kept.keys()).collect();
    names.into_iter().filter(|name| made.get(*name) != kept.get(*name)).map(|n| format!("{n}; run: {FIX}")).collect()
}

#[test]
fn schemas_are_those_of_the_types() {
    let (made, folder) = (made(), spec("schema"));
    if std::env::var_os("MATEVAL_WRITE_SCHEMAS").is_some() {
        for (name, bytes) in &made {
            std::fs::write(folder.join(name), bytes).unwrap();
        }
    }
    assert_eq!(differences(&made, &files(&folder)), Vec::<String>::new());
}

/// The twin: a changed, a missing and an additional file are each found.
#[test]
fn a_changed_schema_is_found() {
    let made = made();
    let mut kept = made.clone();
    let text = String::from_utf8(kept["scene.schema.json"].clone()).unwrap();
    kept.insert("scene.schema.json".into(), text.replace("world_from_camera", "camera_from_world").into_bytes());
    kept.remove("lights.schema.json");
    kept.insert("old.schema.json".into(), b"{}".to_vec());
    let expected = ["lights", "old", "scene"].map(|name| format!("{name}.schema.json; run: {FIX}"));
    assert_eq!(differences(&made, &kept), expected);
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The violations of a schema.
pub(super) fn breaches(name: &str, example: &Value) -> Vec<String> {
    let schema = json(&spec(&format!("schema/{name}.schema.json")));
    let validator = jsonschema::validator_for(&schema).unwrap();
    validator.iter_errors(example).map(|error| format!("{}: {error}", error.instance_path())).collect()
}

#[test]
fn examples_match_their_schemas() {
    let mut seen = 0;
    for name in files(&spec("examples")).keys().filter_map(|name| name.strip_suffix(".json")) {
        let example = json(&spec(&format!("examples/{name}.json")));
        assert_eq!(breaches(name, &example), Vec::<String>::new(), "{name}");
        // The twin: an unknown key, and a missing one.
        let mut unknown = example.clone();
        unknown.as_object_mut().unwrap().insert("colour".to_owned(), Value::Null);
        let mut lacking = example;
        lacking.as_object_mut().unwrap().remove("format");
        assert_eq!([breaches(name, &unknown).len(), breaches(name, &lacking).len()], [1, 1], "{name}");
        seen += 1;
    }
    assert_eq!(seen, 3);
}

#[test]
fn the_example_recipe_can_be_read() {
    let (recipe, text) = mateval_prep::recipe::read(&spec("examples/recipe.toml")).unwrap();
    assert_eq!((recipe.scenes.len(), recipe.views.len()), (2, 2));
    // The twin.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recipe.toml");
    std::fs::write(&path, text.replace("samples", "sample_count")).unwrap();
    assert!(mateval_prep::recipe::read(&path).is_err());
}

#[test]
fn schemas_of_toml_files_allow_what_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recipe.toml");
    let room = "front3d = { house = 'h.json', room = 'R-1', models = 'm' }\ncamera = { seed = 1 }";
    let capture = "capture = { mesh = 'm.ply', cameras = 'c.json', photos = 'p', input = '1', measured = 'm.json' }";
    let unknown = "gltf = 'a.glb'\nexposures = 1";
    let twins = "gltf = 'a.glb'\ntwins = ['alone_1']";
    for (is_sound, above, scene) in [
        (true, "", "bitterli = 'a.xml'"),
        (true, "wide = { count = 4, distance_m = [0.3, 1] }\nlicences = { gltf = 'CC0-1.0' }", twins),
        (true, "wide = { views = [{ id = 'wide_1', offset_m = [1, 0, 0] }] }", room),
        (true, "views = []\nresolution = [16, 8192]\ncamera_rules = '3dlg'", capture),
        (false, "samples = 0", twins),
        (false, "atlas_size = 63", twins),
        (false, "resolution = [15, 16]", twins),
        (false, "wide = { count = 17, distance_m = [0.3, 1] }", twins),
        (false, "wide = { count = 1, distance_m = [0.01, 1] }", twins),
        (false, "views = [{ id = 'up', x_deg = 91, y_deg = 0 }]", twins),
        (false, "camera_rules = 'mine'", twins),
        (false, "licence = 'CC0-1.0'", twins),
        (false, "", "gltf = 'a.glb'\ntwins = ['alone_0']"),
        (false, "", unknown),
    ] {
        let text = format!("name = 'x'\n{above}\n[[scene]]\nid = 'a'\n{scene}\n");
        std::fs::write(&path, &text).unwrap();
        assert_eq!(mateval_prep::recipe::read(&path).is_ok(), is_sound, "{text}");
        assert_eq!(breaches("recipe", &toml::from_str(&text).unwrap()).is_empty(), is_sound, "{text}");
    }
    assert_eq!(breaches("recipe", &json!({ "name": "x" })).len(), 1, "a recipe has a scene");
    let mut seen = 0;
    for (name, bytes) in files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/baselines/adapters")) {
        let Some(adapter) = name.strip_suffix(".toml") else { continue };
        let text = String::from_utf8(bytes).unwrap();
        assert_eq!(breaches("adapter", &toml::from_str(&text).unwrap()), Vec::<String>::new(), "{adapter}");
        // The twin.
        let unknown = text.replace("encoding = ", "transfer = ");
        assert!(!breaches("adapter", &toml::from_str(&unknown).unwrap()).is_empty(), "{adapter}");
        seen += 1;
    }
    assert_eq!(seen, Adapter::names().len());
    assert_eq!(breaches("survey_rules", &json!({ "min_objects": 7 })), Vec::<String>::new());
    assert_eq!(breaches("survey_rules", &json!({ "min_object": 7 })).len(), 1);
}

fn near(found: [f64; 3], expected: [f64; 3], slack: f64) -> bool {
    found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < slack)
}

/// format/dataset.md, "Camera": pixel (60, 210) of the input view, its depth, its place in the world and in `up_left`.
#[test]
fn the_worked_example_of_the_camera_is_right() {
    let text = std::fs::read_to_string(spec("format/dataset.md")).unwrap();
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for numbers in ["2.7076979", "(1.129893, 0.012000, 2.234759)", "2.695910, pixel position (81.6560, 232.5347)"] {
        assert!(text.contains(numbers), "format/dataset.md no longer contains {numbers}");
    }
    let scene: SceneFile = mateval_dataset::json::read(&spec("examples/scene.json")).unwrap();
    let [input, up_left] = [&scene.views[0].camera, &scene.views[1].camera];
    assert!(input.turned(5.0, 5.0).matrix().abs_diff_eq(up_left.matrix(), 1e-12));
    let world = input.unproject([60.5, 210.5].into(), 2.7076979);
    assert!(near(world.to_array(), [1.129893, 0.012, 2.234759], 1e-6), "{world}");
    let (pixel, depth) = up_left.project(world).unwrap();
    assert!(near([pixel.x, pixel.y, depth], [81.6560, 232.5347, 2.695910], 1e-4), "{pixel} {depth}");
    // The twin: with the opposite turn the point lies elsewhere.
    let (other, _) = input.turned(-5.0, 5.0).project(world).unwrap();
    assert!((other - pixel).length() > 10.0);
}
