//! External labels as a second set of parts: `part_labels` in a recipe.

use std::path::{Path, PathBuf};

use mateval_image::png_io;
use mateval_testkit::npy;
use serde_json::Value;

use super::command::{Run, build, run, verify};
use super::planted::{Room, rehash};
use super::sample::{SMALL, dataset, json, write_source};

/// A source whose recipe names labels.
struct Labelled {
    folder: tempfile::TempDir,
    recipe: PathBuf,
}

impl Labelled {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let recipe = write_source(&folder.path().join("source"), SMALL, &["room"]);
        let mut text = std::fs::read_to_string(&recipe).unwrap();
        text.push_str("part_labels = { partfield = \"labels/partfield\" }\n");
        std::fs::write(&recipe, text).unwrap();
        std::fs::create_dir_all(folder.path().join("source/room/labels/partfield")).unwrap();
        Self { folder, recipe }
    }

    fn label(&self, instance: &str, labels: &[i64]) {
        let path = self.folder.path().join(format!("source/room/labels/partfield/{instance}.npy"));
        std::fs::write(path, npy(labels, &[labels.len() as u64])).unwrap();
    }

    fn dataset(&self) -> PathBuf {
        self.folder.path().join("dataset")
    }

    fn build(&self) -> Run {
        run(&mut build(&self.recipe, &self.dataset()))
    }
}

fn triangles_of(instance: &str) -> usize {
    let scene = json(&dataset().join("scenes/room/scene.json"));
    let found = scene["instances"].as_array().unwrap().iter().find(|entry| entry["id"] == instance);
    found.unwrap()["triangles"].as_u64().unwrap() as usize
}

fn parts_of<'a>(parts: &'a Value, instance: &str) -> Vec<&'a Value> {
    parts.as_array().unwrap().iter().filter(|part| part["instance"] == instance).collect()
}

/// The number of different values of the picture where it shows the sofa.
fn values_on_the_sofa(view: &Path, picture: &str) -> usize {
    let read = |file: &str| png_io::read_ids(&view.join(file)).unwrap();
    let scene = json(&view.join("../../scene.json"));
    let sofa = scene["instances"].as_array().unwrap().iter().find(|entry| entry["id"] == "sofa").unwrap();
    let index = sofa["index"].as_u64().unwrap() as u16;
    let (instance, part) = (read("instance.png"), read(picture));
    let values = instance.pixels().iter().zip(part.pixels()).filter(|(instance, _)| **instance == index);
    values.map(|(_, part)| part).collect::<std::collections::BTreeSet<_>>().len()
}

#[test]
fn labels_become_a_second_set_of_parts() {
    let labelled = Labelled::new();
    let count = triangles_of("sofa");
    labelled.label("sofa", &(0..count).map(|at| i64::from(at < count / 2)).collect::<Vec<_>>());
    (0..12).for_each(|at| labelled.label(&format!("sofa-{at:02}"), &[0]));
    let unused = "warning [unused_labels] 'labels/partfield': 12 files of 'partfield' match no instance: \
                  'sofa-00.npy', 'sofa-01.npy'";
    labelled.build().ends_with(0).says(unused).says("'sofa-09.npy' and 2 more; ignored them");
    run(&mut verify(&labelled.dataset())).ends_with(0);
    let room = labelled.dataset().join("scenes/room");
    let scene = json(&room.join("scene.json"));
    let set = &scene["part_sets"][0];
    assert_eq!(set["id"], "partfield");
    assert_eq!(parts_of(&set["parts"], "sofa").len(), 2);
    let files = scene["source"]["files"].as_array().unwrap();
    assert!(files.iter().any(|file| file["path"] == "labels/partfield/sofa.npy"), "{files:?}");
    // An instance without labels keeps its own parts, which is reported.
    assert_eq!(parts_of(&set["parts"], "shelf").len(), parts_of(&scene["parts"], "shelf").len());
    let findings = scene["findings"].as_array().unwrap();
    assert!(findings.iter().any(|f| f["code"] == "unlabelled" && f["message"].as_str().unwrap().contains("'shelf'")));
    // The source's own parts are the same as without labels.
    assert_eq!(scene["parts"], json(&dataset().join("scenes/room/scene.json"))["parts"]);
    let view = room.join("views/input");
    assert!(values_on_the_sofa(&view, "part.png") > 2);
    assert_eq!(values_on_the_sofa(&view, "part_partfield.png"), 2);

    // The twin: a changed picture or mesh of the set is found.
    Room::of(&labelled.dataset()).edit_ids("views/input/part_partfield.png", |id| if id < 2 { id } else { id - 1 });
    rehash(&labelled.dataset());
    let verdict = run(&mut verify(&labelled.dataset())).ends_with(1);
    assert!(verdict.stdout.contains("scenes/room/views/input/part_partfield.png"), "{}", verdict.stdout);
    std::fs::copy(room.join("geometry/parts.glb"), room.join("geometry/parts_partfield.glb")).unwrap();
    rehash(&labelled.dataset());
    let verdict = run(&mut verify(&labelled.dataset())).ends_with(1);
    assert!(verdict.stdout.contains("scenes/room/geometry/parts_partfield.glb"), "{}", verdict.stdout);
}

#[test]
fn labels_that_do_not_fit_are_refused_all_at_once() {
    let labelled = Labelled::new();
    labelled.build().ends_with(2).says("'labels/partfield' has no file '<instance>.npy' for any instance");
    let (sofa, table) = (triangles_of("sofa"), triangles_of("table"));
    labelled.label("sofa", &vec![0; sofa - 1]);
    labelled.label("table", &vec![0; table + 1]);
    let refused = labelled.build().ends_with(2);
    refused.clone().says(&format!("sofa.npy' has {} labels; expected {sofa}", sofa - 1));
    refused.says(&format!("table.npy' has {} labels; expected {table}", table + 1));
    std::fs::remove_dir_all(labelled.folder.path().join("source/room/labels")).unwrap();
    labelled.build().ends_with(2).says("correct `part_labels`");
}
