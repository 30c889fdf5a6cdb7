//! A scene with a photo from elsewhere in place of a rendered input picture: it takes part in every step that needs no
//! light, and says where it does not.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_image::transfer::linear_from_srgb;
use mateval_image::{Picture, exr_io, png_io};
use mateval_testkit::{copy_folder, kept_folder};
use serde_json::{Value, json};

use super::command::{baseline, build, mateval, render, run, run_words, verify};
use super::sample::{json as json_of, write_source};

const HEAD: &str = "resolution = [64, 48]\natlas_size = 128\nviews = [{ id = \"left\", x_deg = 0, y_deg = 5 }]\n";
const EXPOSURE: f64 = 2.0;

/// A picture of 8-bit sRGB without two equal neighbours.
fn photo() -> Picture<[u8; 3]> {
    Picture::from_fn(64, 48, |x, y| [(4 * x) as u8, (5 * y) as u8, (x * y) as u8])
}

/// Writes the sample's source with a recipe whose first scene, `photographed`, has this photo. The others have none.
fn source(folder: &Path, photo_line: &str, others: &[&str]) -> PathBuf {
    let ids: Vec<&str> = std::iter::once("photographed").chain(others.iter().copied()).collect();
    let recipe = write_source(&folder.join("source"), HEAD, &ids);
    let text = std::fs::read_to_string(&recipe).unwrap();
    let with_photo = format!("bitterli = \"room/scene.xml\"\nexposure = {EXPOSURE}\n{photo_line}\n");
    std::fs::write(&recipe, text.replacen("bitterli = \"room/scene.xml\"\n", &with_photo, 1)).unwrap();
    png_io::write_rgb_bytes(&folder.join("source/room/photo.png"), &photo()).unwrap();
    recipe
}

const PHOTO: &str = "photo = \"photo.png\"";

/// A folder with the dataset `mixed`, of a scene with a photo and one without, `alone`, of the former, and
/// `mixed-unrendered` and `alone-unrendered`, copies of both without renders.
static BUILT: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("photo");
    for (name, others) in [("mixed", &["plain"][..]), ("alone", &[])] {
        let place = folder.join(format!("of-{name}"));
        run(&mut build(&source(&place, PHOTO, others), &folder.join(name))).ends_with(0);
        copy_folder(&folder.join(name), &folder.join(format!("{name}-unrendered")));
        run(&mut render(&folder.join(name), 4)).ends_with(0).says("photographed: not rendered");
        run(&mut verify(&folder.join(name))).ends_with(0);
    }
    folder
});

fn dataset(name: &str) -> PathBuf {
    BUILT.join(name)
}

#[test]
fn the_photo_is_the_input_picture() {
    let folder = dataset("mixed").join("scenes/photographed");
    let shown = png_io::read_rgb_bytes(&folder.join("views/input/rgb.png")).unwrap();
    assert_eq!(shown, photo());
    let linear = exr_io::read_linear(&folder.join("views/input/rgb.exr")).unwrap();
    let expected = f64::from(linear_from_srgb(f32::from(photo().get(9, 7)[0]) / 255.0)) / EXPOSURE;
    assert!((f64::from(linear.get(9, 7).0[0]) - expected).abs() < 1e-7);
    let scene = json_of(&folder.join("scene.json"));
    assert_eq!(scene["photo"], json!({ "file": "photo.png", "size": [64, 48], "encoding": "srgb" }));
    let files = scene["source"]["files"].as_array().unwrap();
    assert!(files.iter().any(|file| file["path"] == "photo.png"));
    assert!(!folder.join("ground_truth/renders").exists());
    let plain = dataset("mixed").join("scenes/plain");
    assert!(json_of(&plain.join("scene.json")).get("photo").is_none());
    assert!(plain.join("ground_truth/renders/builtin/input/rgb.exr").is_file());
}

/// A photo of linear light, twice as wide and high as the camera's picture: exposure does not change its values.
#[test]
fn a_larger_photo_of_linear_light_is_reduced() {
    let folder = kept_folder("photo_linear");
    let recipe = source(&folder, "photo = \"photo.exr\"", &[]);
    let large = Picture::from_fn(128, 96, |x, y| mateval_image::LinearRgb([(x % 2) as f32, (y / 2) as f32, 4.0]));
    exr_io::write_linear(&folder.join("source/room/photo.exr"), &large, exr_io::Precision::Float).unwrap();
    run(&mut build(&recipe, &folder.join("dataset"))).ends_with(0);
    let scene = folder.join("dataset/scenes/photographed");
    let shown = exr_io::read_linear(&scene.join("views/input/rgb.exr")).unwrap();
    assert_eq!(shown, Picture::from_fn(64, 48, |_, y| mateval_image::LinearRgb([0.5, y as f32, 4.0])));
    let listed = json!({ "file": "photo.exr", "size": [128, 96], "encoding": "linear" });
    assert_eq!(json_of(&scene.join("scene.json"))["photo"], listed);
}

/// Before it is rendered, exports and scores of light lack the scene that has no photo.
#[test]
fn the_other_scenes_still_need_renders() {
    let folder = kept_folder("photo_unrendered");
    let unrendered = dataset("mixed-unrendered");
    let words = ["prep", "export", "--as", "huggingface", "--out"].map(PathBuf::from);
    run_words(words.into_iter().chain([folder.join("export"), unrendered.clone()])).ends_with(2).says("prep render");
    let missing = result_of(&unrendered)["missing"].clone();
    assert!(missing.as_array().unwrap().iter().any(|missing| missing["metric"] == "rgb_true"), "{missing}");
}

#[test]
fn pictures_of_light_are_those_of_the_other_scenes() {
    let folder = kept_folder("photo_pictures");
    let grey = folder.join("grey");
    run(&mut baseline("grey", &dataset("mixed"), &grey)).ends_with(0);
    let mut pictures = mateval();
    pictures.args(["eval", "pictures", "--samples", "4", "--picture", "albedo", "--picture", "rgb_true"]).arg(&grey);
    pictures.arg("--dataset").arg(dataset("mixed")).arg("--out").arg(folder.join("pictures"));
    run(&mut pictures).ends_with(0).says("have no pictures of light");
    let has = |name: &str| folder.join("pictures").join(name).is_file();
    assert!(has("photographed-albedo.png") && has("plain-rgb_true.png") && !has("photographed-rgb_true.png"));
}

#[test]
fn a_changed_photo_is_found() {
    let twin = kept_folder("photo_changed").join("dataset");
    copy_folder(&dataset("alone"), &twin);
    let folder = twin.join("scenes/photographed");
    exr_io::write_linear(
        &folder.join("views/input/rgb.exr"),
        &Picture::filled(64, 40, mateval_image::LinearRgb([0.5; 3])),
        exr_io::Precision::Float,
    )
    .unwrap();
    let mut scene = json_of(&folder.join("scene.json"));
    scene["photo"]["file"] = "other.png".into();
    std::fs::write(folder.join("scene.json"), scene.to_string()).unwrap();
    std::fs::create_dir(folder.join("ground_truth/renders")).unwrap();
    let found = run(&mut verify(&twin)).ends_with(1);
    found.prints("unlisted_photo").prints("expected 64x48 pixels").prints("unexpected_renders");
}

/// The result of `grey`.
fn result(name: &str) -> Value {
    result_of(&dataset(name))
}

fn result_of(dataset: &Path) -> Value {
    let folder = kept_folder("photo_result");
    let (submission, result) = (folder.join("grey"), folder.join("grey.json"));
    run(&mut baseline("grey", dataset, &submission)).ends_with(0);
    let mut score = mateval();
    score.args(["eval", "score"]).arg(&submission).arg("--dataset").arg(dataset).arg("--out").arg(&result);
    run(&mut score).ends_with(0);
    json_of(&result)
}

#[test]
fn light_is_left_out_where_it_is_not_known() {
    let mixed = result("mixed");
    let scores = &mixed["protocols"]["mateval-3"];
    let keys = |scene: &str| -> Vec<String> { scores["scenes"][scene].as_object().unwrap().keys().cloned().collect() };
    let has = |scene: &str, start: &str| keys(scene).iter().any(|key| key.starts_with(start));
    assert!(has("photographed", "albedo.input") && has("photographed", "albedo.novel"), "{:?}", keys("photographed"));
    assert!(!has("photographed", "rgb_"), "{:?}", keys("photographed"));
    assert!(has("plain", "rgb_true"), "{:?}", keys("plain"));
    // Means of light are of the one scene that has any.
    let psnr = "rgb_true.input.psnr";
    assert_eq!(scores["summary"][psnr], scores["scenes"]["plain"][psnr]);
    let findings = mixed["findings"].as_array().unwrap();
    let about = findings.iter().filter(|finding| finding["code"] == "unknown_light").collect::<Vec<_>>();
    assert_eq!(about.len(), 1);
    assert_eq!(about[0]["file"], "scenes/photographed/scene.json");
    assert!(mixed["missing"].as_array().unwrap().iter().all(|missing| missing["metric"] == "lpips_alex"), "{mixed}");
}

#[test]
fn a_dataset_of_photos_alone_needs_no_renderer() {
    assert!(json_of(&dataset("alone").join("dataset.json"))["photo_renderer"].is_null());
    let alone = result("alone");
    let summary = alone["protocols"]["mateval-3"]["summary"].as_object().unwrap();
    assert!(summary.contains_key("albedo.input.psnr") && !summary.keys().any(|key| key.starts_with("rgb_")));
    assert!(alone["missing"].as_array().unwrap().iter().all(|missing| missing["metric"] == "lpips_alex"), "{alone}");
    for step in ["render", "compare"] {
        let name = dataset("alone");
        run_words([Path::new("prep"), Path::new(step), &name]).ends_with(0).says("photographed: no");
    }
    let compared = run_words([Path::new("prep"), Path::new("compare"), &dataset("alone")]);
    compared.prints("nothing was compared: every scene has a photo");
    let out = kept_folder("photo_export");
    let words = ["prep", "export", "--as", "huggingface", "--out"].map(PathBuf::from);
    run_words(words.into_iter().chain([out.join("export"), dataset("alone")])).ends_with(0);
}

/// A missing photo is reported before the first scene is made, one that does not fit when its scene is.
#[test]
fn a_photo_that_does_not_fit_is_refused() {
    let refused = |line: &str| {
        let folder = kept_folder("photo_refused");
        let recipe = source(&folder, line, &[]);
        std::fs::write(folder.join("source/room/rubbish.png"), b"no picture").unwrap();
        run(&mut build(&recipe, &folder.join("dataset"))).ends_with(2)
    };
    refused("photo = \"none.png\"").says("there is no file").says("none.png").says("`photo`");
    refused("photo = \"../../photo.png\"").says("expected a file below the XML's folder");
    refused(&format!("{PHOTO}\nresolution = [64, 36]")).says("'photo.png' is 64x48").says("64x36");
    refused(&format!("{PHOTO}\nresolution = [128, 96]")).says("at least its size");
    refused("photo = \"rubbish.png\"").says("rubbish.png").says("not a known picture format");
}
