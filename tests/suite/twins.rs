//! Twins of a scene: what they share with it, what their photos are, what is refused for them, and how commands treat
//! them.

use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_dataset::manifest;
use mateval_image::{LinearRgb, Picture, exr_io, png_io};
use mateval_testkit::{copy_folder, kept_folder, want_twins};

use super::command::{baseline, build, mateval, render, run, run_words, score, verify};
use super::sample::{files_below, json, write_source};

const HEAD: &str = "resolution = [64, 48]\natlas_size = 64\nviews = []";
const TWINS: [&str; 3] = ["room--warm_cool", "room--alone_1", "room--alone_2"];

/// The sample's room with three twins, rendered by the built-in tracer.
static DATASET: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("twins");
    let recipe = write_source(&folder.join("source"), HEAD, &["room"]);
    let text = std::fs::read_to_string(&recipe).unwrap();
    let twins = "[[scene]]\ntwins = [\"warm_cool\", \"alone_1\", \"alone_2\"]";
    std::fs::write(&recipe, text.replace("[[scene]]", twins)).unwrap();
    let dataset = folder.join("dataset");
    run(&mut build(&recipe, &dataset)).ends_with(0);
    assert_eq!(json(&dataset.join("dataset.json")).get("twins"), None, "nothing is rendered yet");
    run(&mut render(&dataset, 16)).ends_with(0);
    dataset
});

fn copied() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_folder(&DATASET, folder.path());
    folder
}

fn photo(dataset: &Path, scene: &str) -> Picture<LinearRgb> {
    exr_io::read_linear(&dataset.join("scenes").join(scene).join("views/input/rgb.exr")).unwrap()
}

fn finish(dataset: &Path) {
    run_words([Path::new("prep"), Path::new("finish"), dataset]).ends_with(0);
}

#[test]
fn twins_share_everything_but_light() {
    let file = json(&DATASET.join("dataset.json"));
    let scenes: Vec<&str> = file["scenes"].as_array().unwrap().iter().map(|id| id.as_str().unwrap()).collect();
    assert_eq!(scenes, [["room"].as_slice(), &TWINS].concat());
    assert_eq!(file["twins"][TWINS[2]], serde_json::json!({"of": "room", "lighting": "alone_2"}));
    assert!(!std::fs::read_to_string(DATASET.join("targets.json")).unwrap().contains("--"));
    let room = DATASET.join("scenes/room");
    for id in TWINS {
        let twin = DATASET.join("scenes").join(id);
        let (own, shared): (Vec<PathBuf>, Vec<PathBuf>) = files_below(&twin).into_iter().partition(|file| {
            let [a, b] = [&twin, &room].map(|scene| std::fs::metadata(scene.join(file)).unwrap().ino());
            a != b
        });
        assert_eq!(own, ["scene.json", "views/input/rgb.exr", "views/input/rgb.png"].map(PathBuf::from));
        assert!(shared.iter().any(|file| file.starts_with("ground_truth/materials")) && shared.len() > 20);
        let lit = |file: &PathBuf| ["renders", "reference", "lights.json"].iter().any(|part| file.ends_with(part));
        assert!(!shared.iter().flat_map(|file| file.ancestors()).any(|part| lit(&part.to_owned())));
    }
    run(&mut verify(&DATASET)).ends_with(0);
}

/// By an independent sum over the files: the photo is a mixture of the groups of as much luminance as the scene's own.
#[test]
fn photos_are_weighted_sums_of_the_groups() {
    let group = |at: usize| {
        let file = format!("scenes/room/ground_truth/renders/builtin/input/group_{at:02}.exr");
        exr_io::read_linear(&DATASET.join(file)).unwrap()
    };
    let groups = json(&DATASET.join("scenes/room/ground_truth/lights.json"))["groups"].as_array().unwrap().len();
    let groups: Vec<Picture<LinearRgb>> = (0..groups).map(group).collect();
    let valid = png_io::read_mask(&DATASET.join("scenes/room/views/input/valid.png")).unwrap();
    let luminance = |picture: &Picture<LinearRgb>| -> f64 {
        let lit = picture.pixels().iter().zip(valid.pixels()).filter(|(_, valid)| **valid);
        lit.map(|(LinearRgb([r, g, b]), _)| 0.2126 * f64::from(*r) + 0.7152 * f64::from(*g) + 0.0722 * f64::from(*b))
            .sum()
    };
    let own: f64 = groups.iter().map(luminance).sum();
    let mut brightest: Vec<&Picture<LinearRgb>> = groups.iter().collect();
    brightest.sort_by(|a, b| luminance(b).total_cmp(&luminance(a)));
    for id in TWINS {
        let twin = photo(&DATASET, id);
        assert!((luminance(&twin) / own - 1.0).abs() < 2e-3, "{id}");
    }
    for (id, alone) in [(TWINS[1], brightest[0]), (TWINS[2], brightest[1])] {
        let scale = (own / luminance(alone)) as f32;
        let twin = photo(&DATASET, id);
        let far = |picture: &Picture<LinearRgb>| {
            let pairs = twin.pixels().iter().zip(picture.pixels());
            pairs.map(|(a, b)| (0..3).map(|c| (a.0[c] - scale * b.0[c]).abs()).fold(0.0, f32::max)).fold(0.0, f32::max)
        };
        assert!(far(alone) < 2e-3, "{id}: {}", far(alone));
        assert!(far(brightest[2]) > 0.05, "the twin passes");
    }
}

/// Finishing again changes nothing; other twins come and go without a build, and the scene stays as it is.
#[test]
fn finishing_makes_the_twins_that_the_recipe_wants() {
    let copy = copied();
    let root = copy.path();
    let identity = |root: &Path| json(&root.join("dataset.json"))["manifest_sha256"].clone();
    finish(root);
    assert_eq!(identity(root), identity(&DATASET));
    let recipe = root.join(".build/recipe.toml");
    let text = std::fs::read(&recipe).unwrap();
    want_twins(root, "\"alone_1\"");
    finish(root);
    let scenes = || json(&root.join("dataset.json"))["scenes"].as_array().unwrap().len();
    assert_eq!((scenes(), root.join("scenes/room--alone_2").exists()), (2, false));
    run(&mut verify(root)).ends_with(0);
    // A lighting that the room does not have makes no twin.
    want_twins(root, "\"alone_1\", \"alone_40\"");
    run_words([Path::new("prep"), Path::new("finish"), root]).ends_with(0).says("has no twin 'alone_40'");
    assert_eq!(scenes(), 2);
    std::fs::write(&recipe, text).unwrap();
    finish(root);
    assert_eq!(identity(root), identity(&DATASET));
}

/// Everything that is wrong with twins is found, though the manifest lists what there is.
#[test]
fn faults_of_twins_are_found() {
    let copy = copied();
    let root = copy.path();
    let twin = root.join("scenes/room--alone_1");
    std::fs::copy(root.join("scenes/room--alone_2/views/input/rgb.exr"), twin.join("views/input/rgb.exr")).unwrap();
    let path = root.join("scenes/room--alone_2/scene.json");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("\"exposure\": 1.0", "\"exposure\": 2.0")).unwrap();
    let path = root.join("scenes/room--warm_cool/views/input/valid.png");
    let mask = png_io::read_mask(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    png_io::write_mask(&path, &mask.map(|valid| !valid)).unwrap();
    let path = root.join("dataset.json");
    let mut file = json(&path);
    file["manifest_sha256"] = manifest::write(root).unwrap().into();
    file["twins"]["room--warm_cool"]["of"] = "room--alone_1".into();
    std::fs::write(&path, file.to_string()).unwrap();
    let found = run(&mut verify(root)).ends_with(1);
    for (code, file) in [
        ("other_photo", "scenes/room--alone_1/views/input/rgb.exr"),
        ("other_twin", "scenes/room--alone_2/scene.json"),
        ("other_twin", "scenes/room--warm_cool/views/input/valid.png"),
        ("dangling_reference", "dataset.json"),
        ("wrong_id", "dataset.json"),
    ] {
        let findings: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
        let all = findings["findings"].as_array().unwrap();
        assert!(all.iter().any(|one| one["code"] == code && one["file"] == file), "{code} {file}: {}", found.stdout);
    }
}

/// Commands that work on a scene refuse its twins by name, and methods answer them like any other scene.
#[test]
fn twins_are_answered_and_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let [truth, result] = ["gt", "gt.json"].map(|name| folder.path().join(name));
    run(&mut baseline("gt", &DATASET, &truth)).ends_with(0);
    assert!(TWINS.iter().all(|id| truth.join("scenes").join(id).is_dir()));
    let lint =
        |submission: &Path| run(mateval().args(["eval", "lint"]).arg(submission).arg("--dataset").arg(&*DATASET));
    assert!(!lint(&truth).ends_with(0).stdout.contains("missing_twin"));
    let partial = folder.path().join("partial");
    copy_folder(&truth, &partial);
    std::fs::remove_dir_all(partial.join("scenes").join(TWINS[1])).unwrap();
    lint(&partial).ends_with(0).prints("missing_twin");
    run(score(&truth, &DATASET, &result).args(["--scene", TWINS[0]])).ends_with(2).says("name 'room' instead");
    run(mateval().args(["prep", "render", "--scene", TWINS[0]]).arg(&*DATASET))
        .ends_with(2)
        .says("name 'room' instead");
    let out = folder.path().join("moved");
    run(mateval().args(["prep", "perturb", "--kind", "pose", "--level", "1", "--out"]).arg(&out).arg(&*DATASET))
        .ends_with(2)
        .says("has twins");
    let out = folder.path().join("mitsuba");
    run(mateval().args(["prep", "export", "--as", "mitsuba", "--scene", TWINS[0], "--out"]).arg(&out).arg(&*DATASET))
        .ends_with(2)
        .says("name 'room' instead");
    let camera = folder.path().join("cameras");
    run(mateval()
        .args(["prep", "export", "--as", "nerfstudio", "--with-ground-truth", "--out"])
        .arg(&camera)
        .arg(&*DATASET))
    .ends_with(0);
    assert!(TWINS.iter().all(|id| camera.join(id).is_dir()));
}

/// Twins are published with their scene: their photos are public and their truth is not. Counts, pictures and pages are
/// those of scenes alone.
#[test]
fn twins_are_published_with_their_scene_and_counted_nowhere() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    run(mateval()
        .args(["prep", "publish", "--withhold", "ground_truth", "--open-book", "--public"])
        .arg(place("public"))
        .arg("--private")
        .arg(place("private"))
        .arg("--report")
        .arg(place("report"))
        .arg(&*DATASET))
    .ends_with(0);
    run(&mut verify(&place("public"))).ends_with(0);
    for id in TWINS {
        let [public, private] = ["public", "private"].map(|half| place(half).join("scenes").join(id));
        assert!(public.join("views/input/rgb.exr").is_file() && !public.join("ground_truth").exists(), "{id}");
        assert!(private.join("ground_truth").is_dir() && !private.join("views").exists(), "{id}");
    }
    assert_eq!(json(&place("report/release.json"))["scenes"].as_array().unwrap().len(), 1);
    // Put together again, the halves are the dataset.
    copy_folder(&place("private"), &place("public"));
    run(&mut verify(&place("public"))).ends_with(0);
    let stats = run(mateval().args(["prep", "stats", "--format", "json"]).arg(&*DATASET)).ends_with(0).stdout;
    assert_eq!(serde_json::from_str::<serde_json::Value>(&stats).unwrap()["scenes"], 1);
    let grey = place("grey");
    run(&mut baseline("grey", &DATASET, &grey)).ends_with(0);
    run(mateval()
        .args(["eval", "pictures"])
        .arg(&grey)
        .arg("--dataset")
        .arg(&*DATASET)
        .arg("--out")
        .arg(place("pictures")))
    .ends_with(0);
    let pictures = files_below(&place("pictures"));
    assert!(!pictures.is_empty() && pictures.iter().all(|file| !file.to_string_lossy().contains("--")), "{pictures:?}");
    run(mateval().args(["prep", "export", "--as", "tar", "--out"]).arg(place("tars")).arg(&*DATASET)).ends_with(0);
    assert!(TWINS.iter().all(|id| files_below(&place("tars")).iter().any(|file| file.to_string_lossy().contains(id))));
}

#[test]
fn recipes_with_impossible_twins_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(&folder.path().join("source"), HEAD, &["room", "room--alone_1"]);
    let text = std::fs::read_to_string(&recipe).unwrap();
    let refused = |twins: &str, words: &[&str]| {
        std::fs::write(&recipe, text.replacen("[[scene]]", &format!("[[scene]]\n{twins}"), 1)).unwrap();
        let ended = run(&mut build(&recipe, &folder.path().join("dataset"))).ends_with(2);
        assert!(words.iter().all(|word| ended.error().contains(word)), "{}", ended.stderr);
    };
    refused(
        "twins = [\"warm_cool\", \"warm_cool\"]",
        &["each lighting once", "the id of the twin 'alone_1' of scene 'room'"],
    );
    refused("twins = [\"warm_cool\"]\nphoto = \"room/photo.png\"", &["`twins` need light groups"]);
    refused("twins = [\"dim\"]", &["is not a lighting's name"]);
}
