//! `appearance = "stated"`: a 3D-FRONT room whose roughness and metallic follow from classes of material, from the
//! recipe to the scores. Without the rule, the room states neither.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use serde_json::Value;

use super::command::{baseline, build, render_for_scores, run, score_under, verify};
use super::sample::{copy_source, json};
use mateval_testkit::{copy_folder, kept_folder};

/// The source, and the dataset of its living room with stated materials, rendered.
static STATED: LazyLock<[PathBuf; 2]> = LazyLock::new(|| {
    let folder = kept_folder("stated");
    let (source, dataset) = (folder.join("source"), folder.join("dataset"));
    copy_source(&source);
    // The tables are of metal.
    let info = source.join("house/3D-FUTURE-model/model_info.json");
    let text = std::fs::read_to_string(&info).unwrap();
    std::fs::write(&info, text.replace("\"Solid Wood\"", "\"Metal\"")).unwrap();
    let recipe = recipe(&folder, "appearance = \"stated\", appearance_seed = 5");
    run(build(&recipe, &dataset).arg("--source").arg(&source)).ends_with(0);
    run(&mut render_for_scores(&dataset, 16, 16)).ends_with(0);
    [source, dataset]
});

/// The rendered dataset with stated materials. It has furniture.
pub fn dataset() -> &'static Path {
    &STATED[1]
}

fn recipe(folder: &Path, words: &str) -> PathBuf {
    let path = folder.join("recipe.toml");
    let room = "house = \"house/3D-FRONT/cc000000-5a3b-4e00-8000-000000000001.json\", room = \"LivingDiningRoom-101\", \
                models = \"house/3D-FUTURE-model\", textures = \"house/3D-FRONT-texture\"";
    let text = format!(
        "name = \"stated\"\nresolution = [96, 72]\natlas_size = 256\nviews = []\n[[scene]]\nid = \"room\"\n\
         front3d = {{ {room}, {words} }}\ncamera = {{ seed = 4 }}\n"
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn classes(dataset: &Path) -> Vec<Value> {
    let file = json(&dataset.join("scenes/room/ground_truth/material_classes.json"));
    file["parts"].as_array().unwrap().clone()
}

#[test]
fn parts_have_classes_that_only_the_truth_lists() {
    let [_, dataset] = &*STATED;
    run(&mut verify(dataset)).ends_with(0);
    let scene = json(&dataset.join("scenes/room/scene.json"));
    assert_eq!(
        (&scene["source"]["states_roughness"], &scene["source"]["states_metallic"]),
        (&true.into(), &true.into())
    );
    let parts = scene["parts"].as_array().unwrap();
    let classes = classes(dataset);
    assert_eq!(classes.len(), parts.len());
    let named: BTreeSet<&str> = classes.iter().filter_map(|part| part["class"].as_str()).collect();
    assert!(named.len() >= 5 && named.contains("metal") && named.contains("paint"), "{named:?}");
    assert!(!scene.to_string().contains("smooth_leather") && scene["parts"][0].get("class").is_none());
    // The twin: a list of other parts is a fault.
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("dataset");
    copy_folder(dataset, &other);
    let file = other.join("scenes/room/ground_truth/material_classes.json");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replacen("-p0\"", "-p99\"", 1)).unwrap();
    run(&mut verify(&other)).ends_with(1).prints("wrong_parts");
}

/// The truth scores better than the paper's constants, which missing maps stand for.
#[test]
fn the_truth_beats_the_old_constants() {
    let [_, dataset] = &*STATED;
    let folder = tempfile::tempdir().unwrap();
    let [truth, constant] = ["gt", "constant"].map(|name| folder.path().join(name));
    run(&mut baseline("gt", dataset, &truth)).ends_with(0);
    copy_folder(&truth, &constant);
    for instance in std::fs::read_dir(constant.join("scenes/room")).unwrap() {
        for map in ["roughness.png", "metallic.png"] {
            std::fs::remove_file(instance.as_ref().unwrap().path().join(map)).unwrap();
        }
    }
    let summary = |submission: &Path| {
        let result = submission.with_extension("json");
        let mut command = score_under(&["mateval-3"], submission, dataset, &result);
        run(command.env("MATEVAL_CACHE", folder.path())).ends_with(0);
        json(&result)["protocols"]["mateval-3"]["summary"].clone()
    };
    let (truth, constant) = (summary(&truth), summary(&constant));
    // What the submission never contains has no score.
    for key in ["roughness.input.mae", "metallic.input.mae"] {
        assert!(truth[key].is_f64() && constant[key].is_null(), "{key}");
    }
    for key in ["rgb_true_specular.input", "rgb_true.input"] {
        let psnr = |summary: &Value| summary[format!("{key}.psnr")].as_f64();
        let (better, worse) = (psnr(&truth), psnr(&constant));
        assert!(better.unwrap() > worse.unwrap() + 3.0, "{key}: {better:?} {worse:?}");
    }
}

/// Without the rule the same room has the same geometry and atlases, no classes, and no scores of both parameters.
#[test]
fn without_the_rule_the_room_states_neither() {
    let [source, stated] = &*STATED;
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("dataset");
    let recipe = recipe(folder.path(), "appearance = \"constant\"");
    run(build(&recipe, &dataset).arg("--source").arg(source)).ends_with(0);
    let scene = json(&dataset.join("scenes/room/scene.json"));
    assert_eq!(scene["source"]["states_roughness"], false);
    assert!(!dataset.join("scenes/room/ground_truth/material_classes.json").exists());
    for file in ["geometry/instances.glb", "geometry/parts.glb", "views/input/valid.png", "views/input/part.png"] {
        let read = |dataset: &Path| std::fs::read(dataset.join("scenes/room").join(file)).unwrap();
        assert!(read(&dataset) == read(stated), "{file} differs");
    }
}
