//! Every command handles a dataset of captured rooms, or refuses it by name. The room is the sample's own: its export to
//! nerfstudio, its mesh and regions of its instances.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use mateval_dataset::measured::{MEASUREMENTS_FORMAT, MeasuredArea, MeasurementsFile};
use mateval_dataset::open::Dataset;
use mateval_image::png_io;
use mateval_testkit::{copy_folder, kept_folder};

use super::command::{baseline, build, mateval, render, run, score_under, verify};
use super::sample::{dataset, files_below, json};

const REGIONS: [&str; 2] = ["floor", "sofa"];
const RECIPE: &str = "name = \"captured\"\natlas_size = 64\nlicences = { capture = \"CC0-1.0\" }\n[[scene]]\nid = \"room\"\n\
    [scene.capture]\nmesh = \"mesh.glb\"\ncameras = \"transforms.json\"\nphotos = \"images\"\ninput = \"input\"\n\
    novel = [\"up_left\"]\nmeasured = \"measured.json\"\n";

static CAPTURED: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("captured_rooms");
    let export = folder.join("export");
    let words = ["prep", "export", "--as", "nerfstudio", "--with-ground-truth", "--out"];
    run(mateval().args(words).arg(&export).arg(dataset())).ends_with(0);
    let (source, opened) = (export.join("room"), Dataset::open(dataset()).unwrap());
    let scene = &opened.scenes[0];
    let of_scene = opened.folder(&scene.id);
    std::fs::copy(of_scene.instances(), source.join("mesh.glb")).unwrap();
    let shown = png_io::read_ids(&of_scene.view(&scene.views[0].id).join("instance.png")).unwrap();
    png_io::write_grey_bytes(&source.join("regions.png"), &shown.map(|index| u8::try_from(index).unwrap())).unwrap();
    let region = |name: &str| MeasuredArea {
        name: name.to_owned(),
        photo: "input".to_owned(),
        mask: "regions.png".to_owned(),
        value: scene.instances.iter().find(|instance| instance.id.as_str() == name).unwrap().index.0.get(),
        color: [0.25; 3],
        standard_error: Some([0.01; 3]),
    };
    let regions = REGIONS.map(region).into();
    let file = MeasurementsFile { format: MEASUREMENTS_FORMAT.to_owned(), regions };
    mateval_dataset::json::write(&source.join("measured.json"), &file).unwrap();
    let (recipe, out) = (source.join("recipe.toml"), folder.join("dataset"));
    std::fs::write(&recipe, RECIPE).unwrap();
    run(&mut build(&recipe, &out)).ends_with(0);
    out
});

fn words(words: &[&str], out: &Path) -> Command {
    let mut command = mateval();
    command.args(words).arg(&*CAPTURED).arg("--out").arg(out);
    command
}

#[test]
fn commands_that_make_datasets_know_captured_rooms() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    run(&mut verify(&CAPTURED)).ends_with(0);
    let copy = place("copy");
    copy_folder(&CAPTURED, &copy);
    run(&mut render(&copy, 1)).ends_with(0).says("room: not rendered, since its input picture is a photo");
    run(mateval().args(["prep", "compare"]).arg(&copy)).ends_with(0).prints("nothing was compared");
    run(&mut verify(&copy)).ends_with(0);
    run(mateval().args(["prep", "stats"]).arg(&*CAPTURED)).ends_with(0).prints("capture");
    // What needs the true materials is refused.
    for command in [
        ["prep", "perturb", "--kind", "pose", "--level", "1"].as_slice(),
        &["prep", "export", "--as", "mitsuba", "--scene", "room"],
        &["baseline", "gt", "--dataset"],
    ] {
        run(&mut words(command, &place("refused"))).ends_with(2).says("scene 'room' is captured");
        assert!(!place("refused").exists(), "{command:?}");
    }
    // Other exports show the input photo and no other.
    for (format, views) in
        [("tar", ""), ("croissant", ", 2 views"), ("huggingface", ", 2 views"), ("colmap", ", 1 view")]
    {
        let line = run(&mut words(&["prep", "export", "--as", format], &place(format))).ends_with(0).stdout;
        assert!(line.contains(&format!("1 scene{views}")), "{format}: {line}");
    }
}

/// Photos of other views and measured colours are withheld with the truth, and the halves make the dataset again.
#[test]
fn captured_rooms_are_published_without_their_measurements() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    run(mateval()
        .args(["prep", "publish", "--withhold", "ground_truth", "--open-book", "--public"])
        .arg(place("public"))
        .arg("--private")
        .arg(place("private"))
        .arg("--report")
        .arg(place("report"))
        .arg(&*CAPTURED))
    .ends_with(0);
    run(&mut verify(&place("public"))).ends_with(0);
    let has = |half: &str, name: &str| files_below(&place(half)).iter().any(|file| file.ends_with(name));
    for secret in ["measured.json", "measured.png", "photo.exr"] {
        assert!(has("private", secret) && !has("public", secret), "{secret}");
    }
    let page = std::fs::read_to_string(place("report/index.html")).unwrap();
    assert!(page.contains("--protocol capture-1") && !page.contains("baseline gt"), "{page}");
    assert_eq!(json(&place("report/release.json"))["evaluated"]["albedo"], false);
    let grey = place("grey");
    run(&mut baseline("grey", &place("public"), &grey)).ends_with(0);
    let lint = |dataset: &Path| run(mateval().args(["eval", "lint"]).arg(&grey).arg("--dataset").arg(dataset));
    lint(&place("public")).ends_with(0);
    let score = |name: &str| run(&mut score_under(&["capture-1"], &grey, &place("public"), &place(name)));
    score("early.json").ends_with(2).says("lacks");
    copy_folder(&place("private"), &place("public"));
    run(&mut verify(&place("public"))).ends_with(0);
    score("grey.json").ends_with(0);
    assert_eq!(
        json(&place("grey.json"))["protocols"]["capture-1"]["measured"].as_array().unwrap().len(),
        REGIONS.len()
    );
}

#[test]
fn commands_that_score_know_captured_rooms() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let (grey, result) = (place("grey"), place("grey.json"));
    run(&mut baseline("grey", &CAPTURED, &grey)).ends_with(0);
    run(&mut score_under(&["capture-1"], &grey, &CAPTURED, &result)).ends_with(0);
    // Grey of 0.5 everywhere, beside 0.25.
    let measured = json(&result)["protocols"]["capture-1"]["measured"].as_array().unwrap().clone();
    let names: Vec<&str> = measured.iter().map(|region| region["region"].as_str().unwrap()).collect();
    assert_eq!(names, REGIONS);
    assert!(measured.iter().all(|region| (region["predicted"][0].as_f64().unwrap() - 0.5).abs() < 3e-3));
    run(mateval()
        .args(["eval", "verify"])
        .arg(&result)
        .arg("--submission")
        .arg(&grey)
        .arg("--dataset")
        .arg(&*CAPTURED))
    .ends_with(0);
    run(mateval().args(["eval", "tables", "--protocol", "capture-1"]).arg(&result))
        .ends_with(0)
        .prints("Measured colours");
    run(mateval()
        .args(["eval", "explain", "--protocol", "capture-1", "--scene", "room", "--submission"])
        .arg(&grey)
        .arg("--dataset")
        .arg(&*CAPTURED)
        .arg(&result))
    .ends_with(2)
    .says("scene 'room' is captured");
    run(mateval()
        .args(["eval", "pictures"])
        .arg(&grey)
        .arg("--dataset")
        .arg(&*CAPTURED)
        .arg("--out")
        .arg(place("pictures")))
    .ends_with(0)
    .says("scene room is captured");
    // Without the protocol there is no number, and the command says so.
    run(&mut score_under(&["mateval-3"], &grey, &CAPTURED, &place("other.json")))
        .ends_with(0)
        .says("warning [other_protocol]")
        .says("--protocol capture-1");
    let site = place("site");
    run(mateval()
        .args(["eval", "leaderboard", "--protocol", "capture-1"])
        .arg(&result)
        .arg("--dataset")
        .arg(&*CAPTURED)
        .arg("--submission")
        .arg(&grey)
        .arg("--out")
        .arg(&site))
    .ends_with(0);
    let text = |file: &str| std::fs::read_to_string(site.join(file)).unwrap();
    let scene = text("scenes/room.html");
    assert!(REGIONS.iter().all(|name| scene.contains(&format!("data-v=\"{name}\""))), "{scene}");
    // The placeholders of the truth are not shown as if they were true.
    assert!(site.join("rooms/room/grey.js").is_file() && !site.join("rooms/room/_truth.js").exists());
    assert!(!text("rooms/room.html").contains("the truth"));
    assert!(text("about.html").contains("DATASET --protocol capture-1 --out RESULT.json"));
}
