//! `mateval baseline delight`: base colour from the photo and the geometry.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_metrics::alignment::{channel_scales, scaled};
use mateval_metrics::{Psnr, mse};
use mateval_testkit::{copy_folder, kept_folder};

use super::command::{Run, baseline, build, render, run};
use super::lifting::base_colors;
use super::sample::{files_below, json, write_source};

/// The sample's room, rendered by the built-in tracer.
static DATASET: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("delighting");
    let recipe = write_source(&folder.join("source"), "resolution = [96, 72]\natlas_size = 64", &["room"]);
    run(&mut build(&recipe, &folder.join("dataset"))).ends_with(0);
    run(&mut render(&folder.join("dataset"), 64)).ends_with(0);
    folder.join("dataset")
});

/// The pictures of the dataset's photos on two threads.
static PICTURES: LazyLock<PathBuf> = LazyLock::new(|| {
    let out = kept_folder("delit").join("pictures");
    delight(&DATASET, &out, 2).ends_with(0);
    out
});

fn delight(dataset: &Path, out: &Path, threads: usize) -> Run {
    run(baseline("delight", dataset, out).env("RAYON_NUM_THREADS", threads.to_string()))
}

#[test]
fn threads_do_not_change_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("pictures");
    delight(&DATASET, &out, 1).ends_with(0);
    let files = files_below(&out);
    assert_eq!(files, files_below(&PICTURES));
    for file in files {
        assert!(std::fs::read(out.join(&file)).unwrap() == std::fs::read(PICTURES.join(&file)).unwrap(), "{file:?}");
    }
}

/// Every picture of the page exists, and nothing is loaded from elsewhere.
#[test]
fn the_page_shows_its_pictures() {
    let html = std::fs::read_to_string(PICTURES.join("index.html")).unwrap();
    let shown: Vec<&str> = html.split("<img src=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert_eq!(shown.len(), 7);
    assert!(
        shown.iter().all(|picture| PICTURES.join(picture).is_file())
            && !html.contains("http:")
            && !html.contains("https:"),
        "{shown:?}"
    );
    let lights = json(&PICTURES.join("room/lights.json"));
    assert_eq!(lights["format"], "mateval-fitted-lights/2");
    let names: Vec<&str> =
        lights["lights"].as_array().unwrap().iter().filter_map(|light| light["name"].as_str()).collect();
    assert!(names.contains(&"lamp_shade") && names.contains(&"world_3"), "{names:?}");
    let sources: BTreeSet<&str> =
        lights["lights"].as_array().unwrap().iter().filter_map(|light| light["source"]["type"].as_str()).collect();
    assert_eq!(sources, BTreeSet::from(["instance", "quad", "sky"]));
}

/// PSNR over valid pixels of linear values, each channel times the factor that fits best if `is_aligned`.
fn psnr(found: &Picture<LinearRgb>, truth: &Picture<LinearRgb>, is_aligned: bool) -> f64 {
    let valid = png_io::read_mask(&DATASET.join("scenes/room/views/input/valid.png")).unwrap();
    let found = found.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v.clamp(0.0, 1.0))));
    let scales = if is_aligned { channel_scales(&found, truth, &valid) } else { [1.0; 3] };
    Psnr::from_mse(mse(&scaled(&found, scales), truth, Some(&valid)).unwrap().unwrap()).unwrap().db
}

/// The de-lit photo is nearer to the true base colour than the photo is.
#[test]
fn a_delit_photo_is_nearer_to_the_truth_than_the_photo() {
    let read = |path: &Path| exr_io::read_linear(path).unwrap();
    let scene = DATASET.join("scenes/room");
    let exposure = json(&scene.join("scene.json"))["exposure"].as_f64().unwrap() as f32;
    let photo = read(&scene.join("views/input/rgb.exr")).map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v * exposure)));
    let delit = read(&PICTURES.join("room/base_color.exr"));
    let truth = read(&scene.join("ground_truth/views/input/albedo.exr"));
    for (is_aligned, gain) in [(false, 6.0), (true, 3.0)] {
        let [delit, photo] = [&delit, &photo].map(|picture| psnr(picture, &truth, is_aligned));
        assert!(delit > photo + gain, "aligned: {is_aligned}; {delit} dB, photo {photo} dB");
    }
}

/// The same estimate without files in between; files hold halves of floats, which may round to the next byte.
#[test]
fn an_estimate_needs_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let medians = |name: &str, words: &[&str]| {
        let out = folder.path().join(name);
        run(baseline("median-part", &DATASET, &out).args(words)).ends_with(0);
        base_colors(&out)
    };
    let pictures = PICTURES.to_string_lossy();
    let from_files = medians("files", &["--estimate", &pictures, "--adapter", "delight"]);
    let direct = medians("direct", &["--estimate", "delight"]);
    assert!(!direct.is_empty() && direct.len() == from_files.len());
    for ((name, a), (_, b)) in direct.iter().zip(&from_files) {
        let pairs = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
        assert!(pairs.into_iter().all(|(a, b)| a.abs_diff(*b) <= 1), "{name}");
    }
    run(baseline("nn", &DATASET, &folder.path().join("nn")).args(["--estimate", "delight", "--adapter", "plain"]))
        .ends_with(2)
        .says("--adapter describes the files of a folder");
}

fn relight(pictures: &Path, out: &Path, words: &[&str]) -> Run {
    let mut command = baseline("relight", &DATASET, out);
    run(command.arg(pictures).args(["--samples", "8"]).args(words))
}

/// The mean of the pixels that are valid.
fn mean_of_valid(picture: &Picture<LinearRgb>) -> f64 {
    let valid = png_io::read_mask(&DATASET.join("scenes/room/views/input/valid.png")).unwrap();
    let values =
        { picture.pixels().iter().zip(valid.pixels()) }.filter(|(_, valid)| **valid).map(|(v, _)| v.luminance());
    values.sum::<f64>() / valid.pixels().iter().filter(|valid| **valid).count() as f64
}

/// Under its fitted lights the room is as bright as in the photo, without one of them darker, and without all of them
/// black.
#[test]
fn a_room_is_lit_anew() {
    let folder = tempfile::tempdir().unwrap();
    let photo = exr_io::read_linear(&DATASET.join("scenes/room/views/input/rgb.exr")).unwrap();
    let brightness = |name: &str, words: &[&str]| {
        let out = folder.path().join(name);
        relight(&PICTURES, &out, words).ends_with(0).prints("1 scene;");
        mean_of_valid(&exr_io::read_linear(&out.join("room/relit.exr")).unwrap()) / mean_of_valid(&photo)
    };
    let fitted = brightness("fitted", &[]);
    assert!((fitted - 1.0).abs() < 0.15, "{fitted}");
    let without_lamp = brightness("without", &["--light", "lamp_shade=0"]);
    assert!(without_lamp < 0.98 * fitted, "{without_lamp} {fitted}");
    let twice = brightness("twice", &["--light", "lamp_shade=5", "--light", "lamp_shade=2"]);
    brightness("fivefold", &["--light", "lamp_shade=5"]);
    let page = |name: &str| std::fs::read_to_string(folder.path().join(name).join("index.html")).unwrap();
    assert!(page("fivefold").contains("max=\"5\" step=\"any\" value=\"5\""));
    // Light is linear, but the filter that takes noise out of it is not.
    assert!(((twice - fitted) / (fitted - without_lamp) - 1.0).abs() < 0.15, "{twice} {fitted} {without_lamp}");
    let lights = json(&PICTURES.join("room/lights.json"));
    let all: Vec<String> =
        lights["lights"].as_array().unwrap().iter().map(|l| format!("{}=0", l["name"].as_str().unwrap())).collect();
    let words: Vec<&str> = all.iter().flat_map(|light| ["--light", light]).collect();
    assert_eq!(brightness("dark", &words), 0.0);

    let html = page("without");
    assert!(
        html.contains("value=\"0\"")
            && html.contains("lamp_shade")
            && !html.contains("http:")
            && !html.contains("https:")
    );
    assert_eq!(html.matches("data-light=").count(), html.matches("type=\"range\"").count());
    for picture in ["photo.png", "relit.png"] {
        assert!(folder.path().join("without/room").join(picture).is_file(), "{picture}");
    }
}

#[test]
fn bad_lights() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    relight(&PICTURES, &out, &["--light", "sun=1"])
        .ends_with(2)
        .says("no scene has a light named sun")
        .says("lamp_shade");
    relight(&PICTURES, &out, &["--light", "lamp_shade"]).ends_with(2).says("expected NAME=FACTOR");
    relight(&PICTURES, &out, &["--light", "lamp_shade=-1"]).ends_with(2).says("expected 0 to 1e6");
    relight(&PICTURES, &out, &["--light", "lamp_shade=nan"]).ends_with(2).says("expected 0 to 1e6");
    relight(&DATASET, &out, &[]).ends_with(2).says("holds no folder <scene>/");

    let other = folder.path().join("pictures");
    copy_folder(&PICTURES, &other);
    let path = other.join("room/lights.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let write = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replace(from, to)).unwrap();
    };
    write("mateval-fitted-lights/2", "mateval-fitted-lights/1");
    relight(&other, &out, &[]).ends_with(2).says("mateval-fitted-lights/1");
    write("lamp_shade", "sun");
    relight(&other, &out, &[]).ends_with(2).says("its lights are not those of the scene");
    write("\"room\"", "\"stage\"");
    relight(&other, &out, &[]).ends_with(2).says("its lights are not those of the scene");
    std::fs::write(&path, &text).unwrap();
    let base_color = Picture::filled(8, 8, LinearRgb([0.5; 3]));
    exr_io::write_linear(&other.join("room/base_color.exr"), &base_color, Precision::Float).unwrap();
    relight(&other, &out, &[]).ends_with(2).says("it has 8x8 pixels, the photo 96x72");
    assert!(!out.exists());
}

/// A scene without a photo, a photo of another size, a black one, and a place inside the dataset.
#[test]
fn bad_photos() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("dataset");
    copy_folder(&DATASET, &dataset);
    let out = folder.path().join("pictures");
    let photo = dataset.join("scenes/room/views/input/rgb.exr");
    let write = |picture: &Picture<LinearRgb>| exr_io::write_linear(&photo, picture, Precision::Float).unwrap();

    std::fs::remove_file(&photo).unwrap();
    delight(&dataset, &out, 2).ends_with(2).says("rgb.exr' does not exist").says("mateval prep render");
    write(&Picture::filled(8, 8, LinearRgb([0.5; 3])));
    delight(&dataset, &out, 2).ends_with(2).says("rgb.exr").says("not as large as scene.json says");
    assert!(!out.exists());

    write(&Picture::filled(96, 72, LinearRgb::default()));
    delight(&dataset, &out, 2).ends_with(0);
    let base_color = exr_io::read_linear(&out.join("room/base_color.exr")).unwrap();
    assert!(base_color.pixels().iter().flat_map(|pixel| pixel.0).all(|v| (0.0..=1.0).contains(&v)));

    delight(&dataset, &dataset.join("scenes/pictures"), 2).ends_with(2).says("lies in the dataset");
    delight(&dataset, &out, 2).ends_with(2).says("exists");
}
