//! Surveys of several houses: in one go, resumed and in parts, with the same bytes; chosen scenes; pieces that intersect.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use mateval_files::lease::Lease;
use serde_json::{Value, json};

use super::command::{Run, mateval, run};
use super::sample::{files_below, json as read_json};
use mateval_testkit::{copy_folder, kept_folder};

/// Houses in the source beside the built-in one.
const HOUSES: usize = 5;

/// A source of several houses and their survey, made in one go.
struct Serial {
    source: PathBuf,
    survey: PathBuf,
}

static SERIAL: LazyLock<Serial> = LazyLock::new(|| {
    let folder = kept_folder("survey");
    let (source, survey) = (folder.join("source"), folder.join("survey"));
    let houses = HOUSES.to_string();
    run(mateval().arg("sample").arg(&source).args(["--houses", &houses])).ends_with(0);
    run(choosing(&mut survey_of(&source, &survey), 3)).ends_with(0);
    Serial { source, survey }
});

fn survey_of(source: &Path, out: &Path) -> Command {
    let mut command = mateval();
    command.args(["prep", "survey", "house/3D-FRONT", "--models", "house/3D-FUTURE-model", "--cameras-per-room", "1"]);
    command.args(["--textures", "house/3D-FRONT-texture", "--resolution", "96", "72"]);
    command.arg("--source").arg(source).arg("--out").arg(out);
    command
}

fn choosing(command: &mut Command, scenes: usize) -> &mut Command {
    command.args(["--scenes", &scenes.to_string()])
}

/// The files of the houses, relative to the source.
fn houses(source: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(source.join("house/3D-FRONT")).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names.iter().map(|name| format!("house/3D-FRONT/{name}")).collect()
}

/// Every file that a survey offers, with its bytes. What `.survey` holds is for resuming alone.
fn files(survey: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let offered = files_below(survey).into_iter().filter(|file| !file.starts_with(".survey"));
    offered.map(|file| (file.clone(), std::fs::read(survey.join(file)).unwrap())).collect()
}

#[track_caller]
fn assert_same(survey: &Path) {
    let (found, expected) = (files(survey), files(&SERIAL.survey));
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    assert!(expected.len() > HOUSES, "{:?}", expected.keys());
    for (path, bytes) in &expected {
        assert!(found[path] == *bytes, "{} differs", path.display());
    }
}

#[test]
fn houses_apart_and_a_survey_that_resumes_have_the_bytes_of_one_in_one_go() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("survey");
    let source = &SERIAL.source;
    let apart = |house: &str| run(survey_of(source, &out).args(["--house", house]));
    let all = houses(source);
    assert_eq!(all.len(), HOUSES + 1);
    // The last one first, by its path, and another by its name.
    apart(&all[HOUSES]).ends_with(0).says("without --house");
    assert!(!out.join("survey.json").exists());
    apart(Path::new(&all[1]).file_stem().unwrap().to_str().unwrap()).ends_with(0);
    apart(&all[1]).ends_with(0).says("1 of 1 houses were already searched");
    apart("nowhere").ends_with(2).says("'nowhere' is none of the survey's");
    // A part that a full disk cut short, and thumbnails that are missing.
    let part = first_file(&out.join(".survey/houses"), "cc000000-5a3b-4e00-8000-000001000000");
    let whole = std::fs::read(&part).unwrap();
    std::fs::write(&part, &whole[..whole.len() / 2]).unwrap();
    run(choosing(&mut survey_of(source, &out), 3)).ends_with(0).says("1 of 6 houses were already searched");
    assert_same(&out);

    // Finished surveys are replaced with --force alone, from what is kept; scenes may be chosen otherwise.
    run(&mut survey_of(source, &out)).ends_with(2).says("--force");
    apart(&all[0]).ends_with(2).says("--force");
    run(survey_of(source, &out).arg("--force")).ends_with(0).says("6 of 6 houses were already searched");
    assert_eq!(read_json(&out.join("survey.json"))["selection"], Value::Null);
    run(choosing(survey_of(source, &out).arg("--force"), 3)).ends_with(0);
    assert_same(&out);
    // Other settings are another search.
    let other = run(survey_of(source, &out).args(["--force", "--seed", "5"])).ends_with(0);
    assert!(!other.stderr.contains("already searched"), "{}", other.stderr);
}

fn first_file(folder: &Path, start: &str) -> PathBuf {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let mut found: Vec<PathBuf> = entries
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(start))
        .map(|entry| entry.path())
        .collect();
    found.sort();
    found.remove(0)
}

/// A house and a model that change between two runs; a house that goes away.
#[test]
fn what_has_changed_is_searched_again() {
    let folder = tempfile::tempdir().unwrap();
    let (source, out) = (folder.path().join("source"), folder.path().join("survey"));
    copy_folder(&SERIAL.source, &source);
    copy_folder(&SERIAL.survey, &out);
    let again = |expected: &str| {
        run(choosing(survey_of(&source, &out).arg("--force"), 3)).ends_with(0).says(expected);
    };
    again("6 of 6 houses were already searched");
    assert_same(&out);
    let all = houses(&source);
    let house = source.join(&all[2]);
    let text = std::fs::read_to_string(&house).unwrap();
    std::fs::write(&house, format!("{text} ")).unwrap();
    again("5 of 6 houses were already searched");
    let before = files(&SERIAL.survey);
    assert!(files(&out)[Path::new("survey.json")] == before[Path::new("survey.json")]);
    // The recipe pins the other bytes, of a house that was chosen or not.
    std::fs::remove_file(&house).unwrap();
    again("5 of 5 houses were already searched");
    assert_eq!(read_json(&out.join("survey.json"))["houses"].as_array().unwrap().len(), HOUSES);
    let stem = house.file_stem().unwrap().to_str().unwrap();
    let of_house = |path: &PathBuf| path.to_string_lossy().contains(stem);
    assert!(before.keys().any(of_house) && !files(&out).keys().any(of_house));
    let model = source.join("house/3D-FUTURE-model/cc0f0000-5a3b-4e00-8000-000000000001/raw_model.obj");
    let text = std::fs::read_to_string(&model).unwrap();
    std::fs::write(&model, format!("{text}# a remark\n")).unwrap();
    let all_again = run(choosing(survey_of(&source, &out).arg("--force"), 3)).ends_with(0);
    assert!(!all_again.stderr.contains("5 of 5 houses"), "{}", all_again.stderr);
}

#[test]
fn two_surveys_do_not_write_to_one_folder_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("survey");
    copy_folder(&SERIAL.survey, &out);
    std::fs::remove_file(out.join("survey.json")).unwrap();
    let source = &SERIAL.source;
    let house = houses(source).remove(0);
    let refused = |command: &mut Command| {
        run(command).ends_with(2).says("is at work on");
    };
    let whole = Lease::take(&out.join(".survey/leases/whole"), "the survey").unwrap();
    refused(&mut survey_of(source, &out));
    refused(survey_of(source, &out).args(["--house", &house]));
    drop(whole);
    let part = Lease::take(&out.join(".survey/leases/houses/another"), "a house").unwrap();
    refused(&mut survey_of(source, &out));
    run(survey_of(source, &out).args(["--house", &house])).ends_with(0);
    drop(part);
    run(choosing(&mut survey_of(source, &out), 3)).ends_with(0);
    assert_same(&out);
}

/// The accepted rooms of the survey.
fn accepted(survey: &Path) -> Vec<Value> {
    let file = read_json(&survey.join("survey.json"));
    let houses = file["houses"].as_array().unwrap().iter();
    let rooms = houses.flat_map(|house| house["rooms"].as_array().unwrap().clone());
    rooms.filter(|room| room["rank"].is_u64()).collect()
}

fn mean(rooms: &[&Value], key: &str) -> f64 {
    rooms.iter().map(|room| room[key].as_f64().unwrap()).sum::<f64>() / rooms.len() as f64
}

/// How far rooms are from the paper's, by the formula of format/recipe.md; the houses have rooms of two types.
fn distance(rooms: &[&Value]) -> f64 {
    let living = rooms.iter().filter(|room| room["room_type"] == "LivingDiningRoom").count() as f64;
    let imbalance = 2.0 * (living / rooms.len() as f64 - 0.5).powi(2);
    (mean(rooms, "objects") / 13.2 - 1.0).powi(2) + (mean(rooms, "super_categories") / 4.3 - 1.0).powi(2) + imbalance
}

#[test]
fn chosen_scenes_are_nearer_to_the_papers_than_the_first_ones() {
    let rooms = accepted(&SERIAL.survey);
    let chosen: Vec<&Value> = rooms.iter().filter(|room| room["choice"]["place"].is_u64()).collect();
    let mut by_rank: Vec<&Value> = rooms.iter().collect();
    by_rank.sort_by_key(|room| room["rank"].as_u64());
    assert_eq!((chosen.len(), by_rank[0]["rank"].as_u64()), (3, Some(1)));
    let first: Vec<&Value> = rooms.iter().take(3).collect();
    assert!(distance(&chosen) < distance(&by_rank[..3]), "{} {}", distance(&chosen), distance(&by_rank[..3]));
    assert!(distance(&chosen) < distance(&first), "{} {}", distance(&chosen), distance(&first));
    assert!(rooms.iter().all(|room| !room["choice"]["reason"].as_str().unwrap().is_empty()));
    let file = read_json(&SERIAL.survey.join("survey.json"));
    assert_eq!(file["selection"]["objects"]["mean"].as_f64().unwrap(), mean(&chosen, "objects"));
    assert_eq!(file["camera_rules"], "blenderproc");
    // The recipe holds them alone, each under its reason.
    let recipe = std::fs::read_to_string(SERIAL.survey.join("recipe.toml")).unwrap();
    assert_eq!(recipe.matches("[[scene]]").count(), 3);
    assert!(recipe.contains("camera_rules = \"blenderproc\""));
    for room in &chosen {
        let reason = room["choice"]["reason"].as_str().unwrap();
        let id = room["cameras"][0]["scene"].as_str().unwrap();
        assert!(recipe.contains(&format!("# {reason}\n[[scene]]\nid = \"{id}\"\n")), "{reason}");
    }
    // Every accepted room was refused for a reason or chosen, at most one of each house.
    let left = rooms.iter().filter(|room| room["choice"]["place"].is_null()).count();
    assert_eq!(left + 3, rooms.len());
}

#[test]
fn fewer_rooms_than_scenes_and_no_rooms_are_the_answer_no() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("survey");
    copy_folder(&SERIAL.survey, &out);
    let source = &SERIAL.source;
    let few: Run = run(choosing(survey_of(source, &out).arg("--force"), 50)).ends_with(1);
    few.says("50 scenes were wanted").says("--scenes-per-house");
    assert_eq!(read_json(&out.join("survey.json"))["selection"]["chosen"].as_u64(), Some(HOUSES as u64 + 1));
    let rules = folder.path().join("rules.toml");
    std::fs::write(&rules, "min_objects = 60\n").unwrap();
    let mut none = survey_of(source, &folder.path().join("none"));
    let none = run(choosing(none.arg("--rules").arg(&rules), 3)).ends_with(1);
    none.prints("0 of 0 rooms chosen, with none objects");
    // Words that do not go together.
    run(choosing(survey_of(source, &out).args(["--house", "x"]), 3)).ends_with(2).says("cannot be used with");
}

/// The fork's rules are recorded, and a recipe's seed draws the camera that the survey found.
#[test]
fn camera_rules_are_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("survey");
    let house = houses(&SERIAL.source).remove(0);
    let mut command = mateval();
    command.args(["prep", "survey", &house, "--models", "house/3D-FUTURE-model", "--camera-rules", "3dlg"]);
    command.args(["--cameras-per-room", "1", "--source"]).arg(&SERIAL.source).arg("--out").arg(&out);
    run(&mut command).ends_with(0);
    let recipe = std::fs::read_to_string(out.join("recipe.toml")).unwrap();
    assert!(recipe.contains("resolution = [480, 360]\ncamera_rules = \"3dlg\"\n"), "{recipe}");
    assert!(recipe.contains("fov_y_deg = 73.7397"), "{recipe}");
    assert_eq!(read_json(&out.join("survey.json"))["camera_rules"], "3dlg");
    assert!(accepted(&out).iter().all(|room| room["cameras"][0]["score"].as_f64().unwrap() >= 0.5));
    run(command.args(["--force", "--camera-rules", "mine"])).ends_with(2);
}

/// Moves a piece of the built-in house, and returns its room as a survey sees it.
fn room_with_moved(record: &str, room: usize, position: [f64; 3]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("source");
    copy_folder(&SERIAL.source, &source);
    let mut house = read_json(&source.join("house/3D-FRONT/cc000000-5a3b-4e00-8000-000000000001.json"));
    let children = house["scene"]["room"][room]["children"].as_array_mut().unwrap();
    let piece = children.iter_mut().find(|child| child["ref"] == format!("{record}/model")).unwrap();
    piece["pos"] = json!(position);
    let file = "house/3D-FRONT/moved.json";
    std::fs::write(source.join(file), house.to_string()).unwrap();
    let out = folder.path().join("survey");
    let mut command = mateval();
    command.args(["prep", "survey", file, "--models", "house/3D-FUTURE-model", "--cameras-per-room", "0"]);
    run(command.arg("--source").arg(&source).arg("--out").arg(&out));
    read_json(&out.join("survey.json"))["houses"][0]["rooms"][room].clone()
}

fn is_refused(room: &Value) -> bool {
    room["rejections"].as_array().unwrap().iter().any(|rejection| rejection["rule"] == "max_intersecting")
}

#[test]
fn chairs_under_tables_pass_and_chairs_in_wardrobes_do_not() {
    // Pushed under the table, then so far that its back stands in the middle of the top.
    let under = room_with_moved("1005", 0, [4.0, 0.0, 1.05]);
    assert!(!is_refused(&under), "{under}");
    let through = room_with_moved("1005", 0, [4.0, 0.0, 1.7]);
    assert!(is_refused(&through), "{through}");
    // The stool, free and half in the wardrobe.
    let free = room_with_moved("2004", 1, [8.1, 0.0, 2.5]);
    assert!(!is_refused(&free), "{free}");
    let inside = room_with_moved("2004", 1, [8.6, 0.0, 3.75]);
    assert!(is_refused(&inside), "{inside}");
    let pair = &inside["intersecting"][0];
    assert!(pair["depth_m"].as_f64().unwrap() > 0.1 && pair["volume_share"].as_f64().unwrap() > 0.1, "{pair}");
}
