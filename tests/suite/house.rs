//! The built-in 3D-FRONT house, with a third room and faults, from survey to score: accepted and rejected rooms, a recipe
//! with hashes, a dataset, and the scores of its ceiling and floor baselines.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use serde_json::Value;

use super::command::{Run, baseline, build, mateval, run, score_under, stats, verify};
use super::sample::{files_below, json};
use mateval_testkit::faulty_house;
use mateval_testkit::{copy_folder, kept_folder};

/// The house and its survey.
struct Surveyed {
    source: PathBuf,
    survey: PathBuf,
}

static SURVEYED: LazyLock<Surveyed> = LazyLock::new(|| {
    let folder = kept_folder("house");
    let (source, survey) = (folder.join("source"), folder.join("survey"));
    faulty_house::write(&source);
    run(&mut survey_of(&source, &survey)).ends_with(0);
    Surveyed { source, survey }
});

fn survey_of(source: &Path, out: &Path) -> Command {
    let mut command = mateval();
    command.args(["prep", "survey", "house/3D-FRONT", "--models", "house/3D-FUTURE-model"]);
    command.args(["--textures", "house/3D-FRONT-texture", "--cameras-per-room", "1", "--resolution", "96", "72"]);
    command.arg("--source").arg(source).arg("--out").arg(out);
    command
}

fn rooms() -> Vec<Value> {
    json(&SURVEYED.survey.join("survey.json"))["houses"][0]["rooms"].as_array().unwrap().clone()
}

/// The recipe of the survey with these lines in place of its resolution.
fn recipe(folder: &Path, lines: &str) -> PathBuf {
    const RESOLUTION: &str = "resolution = [96, 72]";
    let text = std::fs::read_to_string(SURVEYED.survey.join("recipe.toml")).unwrap();
    assert!(text.contains(RESOLUTION), "{text}");
    let path = folder.join("recipe.toml");
    std::fs::write(&path, text.replacen(RESOLUTION, lines, 1)).unwrap();
    path
}

fn build_from(recipe: &Path, source: &Path, dataset: &Path) -> Run {
    run(build(recipe, dataset).arg("--source").arg(source))
}

#[test]
fn sound_rooms_are_accepted_and_the_faulty_one_is_rejected_with_reasons() {
    let offered: Vec<Value> =
        rooms().iter().filter(|r| r["cameras"][0].is_object()).map(|r| r["room"].clone()).collect();
    assert_eq!(offered, ["LivingDiningRoom-101", "MasterBedroom-102"]);
    let store = rooms().into_iter().find(|room| room["room"] == "OtherRoom-103").unwrap();
    let rejections = store["rejections"].as_array().unwrap().iter();
    let rules: Vec<String> = rejections.map(|rejection| rejection["rule"].as_str().unwrap().to_owned()).collect();
    assert_eq!(rules, ["max_intersecting", "max_missing"], "{store}");
    assert_eq!(store["intersecting"].as_array().unwrap().len(), 1, "{store}");
}

/// Pieces whose records have neither category nor title, as in later releases, are named by `model_info.json`: either set
/// of camera rules finds the same rooms and cameras as in the house with names. The twin: without that file all pieces
/// are of one kind.
#[test]
fn names_of_pieces_come_from_model_info() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("source");
    copy_folder(&SURVEYED.source, &source);
    let houses = files_below(&source.join("house/3D-FRONT"));
    let mut nameless = 0;
    for house in houses.iter().filter(|house| house.extension().is_some_and(|extension| extension == "json")) {
        let path = source.join("house/3D-FRONT").join(house);
        let mut document = json(&path);
        for piece in document["furniture"].as_array_mut().unwrap() {
            let record = piece.as_object_mut().unwrap();
            nameless += usize::from(record.remove("category").is_some() | record.remove("title").is_some());
        }
        std::fs::write(&path, document.to_string()).unwrap();
    }
    assert!(nameless > 5, "{nameless}");
    let rooms = |source: &Path, rules: &str, code: i32| {
        let out = folder.path().join(format!("survey-{rules}-{code}-{}", source == SURVEYED.source));
        run(survey_of(source, &out).args(["--camera-rules", rules])).ends_with(code);
        let mut rooms = json(&out.join("survey.json"))["houses"][0]["rooms"].clone();
        // These name pieces, and one whose model the list lacks has only the house's name.
        for room in rooms.as_array_mut().unwrap() {
            room["intersecting"].take();
            room["rejections"]
                .as_array_mut()
                .unwrap()
                .iter_mut()
                .for_each(|rejection| drop(rejection["reason"].take()));
        }
        rooms
    };
    for rules in ["blenderproc", "3dlg"] {
        let found = rooms(&source, rules, 0);
        assert!(found.as_array().unwrap().iter().filter(|room| room["cameras"][0].is_object()).count() == 2, "{found}");
        assert_eq!(found, rooms(&SURVEYED.source, rules, 0), "{rules}");
    }
    std::fs::remove_file(source.join("house/3D-FUTURE-model/model_info.json")).unwrap();
    for room in rooms(&source, "3dlg", 1).as_array().unwrap() {
        assert_eq!(room["super_categories"], 1, "{room}");
    }
}

#[test]
fn the_page_shows_every_candidate_and_every_rejection() {
    let page = std::fs::read_to_string(SURVEYED.survey.join("index.html")).unwrap();
    for room in rooms() {
        for camera in room["cameras"].as_array().unwrap() {
            let thumbnail = camera["thumbnail"].as_str().unwrap();
            assert!(SURVEYED.survey.join(thumbnail).is_file(), "{thumbnail}");
            assert!(page.contains(camera["scene"].as_str().unwrap()));
        }
        for rejection in room["rejections"].as_array().unwrap() {
            assert!(page.contains(rejection["rule"].as_str().unwrap()), "{rejection}");
        }
    }
}

#[test]
fn a_rule_rejects_with_its_reason_and_a_survey_is_reproducible_to_the_byte() {
    let folder = tempfile::tempdir().unwrap();
    let [rules, out] = ["rules.toml", "survey"].map(|name| folder.path().join(name));
    std::fs::write(&rules, "room_types = [\"LivingDiningRoom\"]\n").unwrap();
    run(survey_of(&SURVEYED.source, &out).arg("--rules").arg(&rules)).ends_with(0);
    let bedroom = json(&out.join("survey.json"))["houses"][0]["rooms"][1].clone();
    assert_eq!(bedroom["rejections"][0]["rule"], "room_types");
    assert!(bedroom["rejections"][0]["reason"].as_str().unwrap().contains("'MasterBedroom'"), "{bedroom}");
    run(&mut survey_of(&SURVEYED.source, &out)).ends_with(2).says("--force");
    // What else lies there stays.
    let notes = ["notes.txt", "thumbnails/notes.txt"].map(|name| out.join(name));
    notes.iter().for_each(|notes| std::fs::write(notes, "mine").unwrap());
    run(survey_of(&SURVEYED.source, &out).arg("--force")).ends_with(0);
    assert!(notes.iter().all(|notes| notes.is_file()));
    let elsewhere = folder.path().join("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    std::fs::write(elsewhere.join("notes.txt"), "mine").unwrap();
    run(survey_of(&SURVEYED.source, &elsewhere).arg("--force")).ends_with(2).says("choose another --out");
    for file in ["survey.json", "recipe.toml", "index.html"] {
        let read = |folder: &Path| std::fs::read(folder.join(file)).unwrap();
        assert!(read(&out) == read(&SURVEYED.survey), "{file} differs");
    }
}

/// From the recipe to scores: the dataset is sound and can be counted, and its truth scores far better than grey.
#[test]
fn accepted_rooms_become_a_dataset_that_can_be_scored() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("dataset");
    let recipe = recipe(folder.path(), "resolution = [96, 72]\natlas_size = 256");
    build_from(&recipe, &SURVEYED.source, &dataset).ends_with(0);
    run(&mut verify(&dataset)).ends_with(0);
    let counted = run(stats(&dataset).args(["--format", "json"])).ends_with(0);
    let counted: Value = serde_json::from_str(&counted.stdout).unwrap();
    assert_eq!((&counted["houses"], &counted["scenes"]), (&1.into(), &2.into()));
    assert!(counted["objects_per_scene"]["mean"].as_f64().unwrap() > 5.0, "{counted}");
    let psnr = |name: &str| {
        let [submission, result] = [name.to_owned(), format!("{name}.json")].map(|name| folder.path().join(name));
        run(&mut baseline(name, &dataset, &submission)).ends_with(0);
        let mut command = score_under(&["mateval-3"], &submission, &dataset, &result);
        run(command.env("MATEVAL_CACHE", folder.path())).ends_with(0);
        json(&result)["protocols"]["mateval-3"]["summary"]["albedo.input.psnr"].as_f64().unwrap()
    };
    let (truth, grey) = (psnr("gt"), psnr("grey"));
    assert!(truth > 25.0 && grey < 15.0, "gt {truth} dB, grey {grey} dB");
}

#[test]
fn a_recipe_refuses_files_that_are_not_those_it_pins() {
    let folder = tempfile::tempdir().unwrap();
    let (source, dataset) = (folder.path().join("source"), folder.path().join("dataset"));
    copy_folder(&SURVEYED.source, &source);
    let recipe = recipe(folder.path(), "resolution = [32, 24]\natlas_size = 64\nviews = []");
    let model = "house/3D-FUTURE-model/cc0f0000-5a3b-4e00-8000-000000000001/raw_model.obj";
    let mut text = std::fs::read_to_string(source.join(model)).unwrap();
    text.push_str("# one remark more\n");
    std::fs::write(source.join(model), text).unwrap();
    build_from(&recipe, &source, &dataset).ends_with(2).says(&format!("input '{model}' has the hash "));
    assert!(!dataset.join("dataset.json").exists());
    // The twin: with the hashes taken out the same source builds.
    let text = std::fs::read_to_string(&recipe).unwrap();
    let without: Vec<&str> =
        text.lines().filter(|l| !l.starts_with("[scene.inputs]") && !l.starts_with("\"house/")).collect();
    std::fs::write(&recipe, without.join("\n")).unwrap();
    build_from(&recipe, &source, &dataset).ends_with(0);
}

/// A designer's camera 2 mm from a wall, which would be noise in half of the picture.
#[test]
fn cameras_in_a_wall_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("source");
    copy_folder(&SURVEYED.source, &source);
    let camera = r#"{ "pos": [0.002, 1.2, 0.5], "target": [0.002, 1.2, 4.0], "fov": 60.0 }"#;
    let entry = format!(r#"{{ "cc000000-5a3b-4e00-8000-000000000001_7.jpg": {{ "camera": {camera} }} }}"#);
    std::fs::write(source.join("cameras.json"), entry).unwrap();
    let room_with = |name: &str, more: &str| {
        let [rules, out] = [format!("{name}.toml"), name.to_owned()].map(|name| folder.path().join(name));
        std::fs::write(&rules, format!("min_seen_objects = 0\nmax_outside = 1.0\n{more}")).unwrap();
        let mut command = survey_of(&source, &out);
        command.args(["--cameras", "cameras.json", "--rules"]).arg(&rules);
        run(&mut command).ends_with(0);
        json(&out.join("survey.json"))["houses"][0]["rooms"][0].clone()
    };
    let origins = |room: &Value| {
        let cameras = room["cameras"].as_array().unwrap().iter();
        cameras.map(|camera| camera["origin"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(origins(&room_with("default", "")), ["seed 1"]);
    // The twin.
    let mut both = origins(&room_with("any", "min_nearest_m = 0.0"));
    both.sort();
    assert_eq!(both, ["designer 7", "seed 1"]);
}

/// A room that is rejected for its number of pieces is not searched for pairs that intersect, which takes minutes for
/// thousands of pieces.
#[test]
fn crowded_rooms_are_not_searched() {
    let folder = tempfile::tempdir().unwrap();
    let [rules, out] = ["rules.toml", "survey"].map(|name| folder.path().join(name));
    std::fs::write(&rules, "min_objects = 0\nmax_objects = 0\n").unwrap();
    run(survey_of(&SURVEYED.source, &out).arg("--rules").arg(&rules)).ends_with(1);
    let rooms = json(&out.join("survey.json"))["houses"][0]["rooms"].clone();
    for room in rooms.as_array().unwrap() {
        assert_eq!(room["rejections"][0]["rule"], "max_objects", "{room}");
        assert_eq!(room["intersecting"], Value::Array(Vec::new()), "{room}");
    }
}

/// A dataset does not depend on locations on a machine: absolute paths are made relative or refused.
#[test]
fn no_absolute_path_ends_in_a_survey_or_a_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let source = &SURVEYED.source;
    let [houses, models] = ["3D-FRONT", "3D-FUTURE-model"].map(|name| source.join("house").join(name));
    let survey = |out: &str, more: &[&Path]| {
        let mut command = mateval();
        command.args(["prep", "survey", "--cameras-per-room", "1", "--resolution", "96", "72", "--out"]);
        // If all paths lie below the current folder, that folder is the source.
        command.current_dir(folder.path());
        run(command.arg(folder.path().join(out)).arg(&houses).arg("--models").arg(&models).args(more))
    };
    let holds_place = |path: &Path| std::fs::read_to_string(path).unwrap().contains(source.to_str().unwrap());
    let surveyed = survey("absolute", &[]).ends_with(0);
    let common = source.join("house").canonicalize().unwrap();
    surveyed.says(&format!("build with --source '{}'", common.display()));
    let [recipe, surveyed] = ["recipe.toml", "survey.json"].map(|name| folder.path().join("absolute").join(name));
    assert!(!holds_place(&recipe) && !holds_place(&surveyed));
    survey("named", &[Path::new("--source"), source]).ends_with(0);
    let text = std::fs::read_to_string(folder.path().join("named/recipe.toml")).unwrap();
    assert!(text.contains("models = \"house/3D-FUTURE-model\""), "{text}");
    survey("elsewhere", &[Path::new("--source"), &houses]).ends_with(2).says("with --source");

    // In a hand-written recipe, paths below the source are made relative to it and others are refused.
    let text = std::fs::read_to_string(&recipe).unwrap();
    let first = text.find("[scene.inputs]").unwrap();
    let absolute = format!("atlas_size = 64\nviews = []\n{}", &text[..first])
        .replace("models = \"3D-FUTURE-model\"", &format!("models = {models:?}"));
    assert!(absolute.contains(models.to_str().unwrap()), "{absolute}");
    std::fs::write(&recipe, &absolute).unwrap();
    let dataset = folder.path().join("dataset");
    build_from(&recipe, &houses, &dataset).ends_with(2).says("models: ").says("does not lie below").says("--source");
    build_from(&recipe, &common, &dataset).ends_with(0);
    let scene = json(&dataset.join("dataset.json"))["scenes"][0].as_str().unwrap().to_owned();
    assert!(!holds_place(&dataset.join("scenes").join(scene).join("scene.json")));
}

/// Folders that every house needs are checked first; a house named twice is surveyed once.
#[test]
fn a_survey_refuses_folders_that_do_not_exist() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("survey");
    let with = |words: &[&str]| {
        let mut command = mateval();
        command.args(["prep", "survey", "--source"]).arg(&SURVEYED.source).arg("--out").arg(&out);
        run(command.args(["--cameras-per-room", "0"]).args(words))
    };
    with(&["house/3D-FRONT", "--models", "house/3D-FUTURE-modell"])
        .ends_with(2)
        .says("3D-FUTURE-modell' does not exist");
    with(&["house/3D-FRUNT", "--models", "house/3D-FUTURE-model"]).ends_with(2).says("3D-FRUNT' does not exist");
    assert!(!out.exists());
    let house = "house/3D-FRONT/cc000000-5a3b-4e00-8000-000000000001.json";
    with(&["house/3D-FRONT", house, "--models", "house/3D-FUTURE-model"]);
    assert_eq!(json(&out.join("survey.json"))["houses"].as_array().unwrap().len(), 1);
}

/// Thirteen generated rooms without the list of models: a warning in each is one line with a count, and the sum of all
/// findings can be printed later.
#[test]
fn many_rooms_print_a_screen() {
    let folder = tempfile::tempdir().unwrap();
    let (source, dataset) = (folder.path().join("source"), folder.path().join("dataset"));
    run(mateval().arg("sample").arg(&source).args(["--houses", "13"])).ends_with(0);
    std::fs::remove_file(source.join("house/3D-FUTURE-model/model_info.json")).unwrap();
    let recipe = source.join("recipe.toml");
    let text = std::fs::read_to_string(&recipe).unwrap();
    let small = text.replace("resolution = [320, 240]", "resolution = [32, 24]\natlas_size = 64\nviews = []");
    std::fs::write(&recipe, small).unwrap();
    let built = run(&mut build(&recipe, &dataset)).ends_with(0).prints("13 scenes");
    let lines: Vec<&str> = built.stderr.lines().filter(|line| line.contains('[')).collect();
    let warning = "warning [missing_file], 13 findings in 13 scenes; first in living000: ";
    assert_eq!(lines.iter().filter(|line| line.starts_with(warning)).count(), 1, "{}", built.stderr);
    assert!(lines.len() <= 12 && built.stderr.lines().count() <= 40, "{}", built.stderr);
    assert!(built.stderr.contains("each scene.json lists its own"), "{}", built.stderr);
    let found = run(stats(&dataset).args(["--findings", "--format", "json"])).ends_with(0);
    let found: Value = serde_json::from_str(&found.stdout).unwrap();
    let code = found["codes"].as_array().unwrap().iter().find(|code| code["code"] == "missing_file").unwrap();
    assert_eq!(
        (&code["findings"], &code["scenes"], &code["first_scene"]),
        (&13.into(), &13.into(), &"living000".into())
    );
    assert_eq!(found["scenes"].as_array().unwrap().len(), 13);
    run(stats(&dataset).arg("--findings")).ends_with(0).prints("missing_file");
    run(stats(&dataset).args(["--findings", "--picture", "x.svg"])).ends_with(2).says("cannot be used with");
    // Run again, the scenes that are there are a count.
    run(&mut build(&recipe, &dataset)).ends_with(0).says("13 of 13 scenes were already made");
}
