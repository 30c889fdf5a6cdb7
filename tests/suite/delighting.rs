//! `mateval baseline delight`: base colour from the photo and the geometry.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_metrics::{Psnr, channel_scales, mse, scaled};
use mateval_testkit::kept_folder;

use super::command::{Run, baseline, build, render_photos, run};
use super::lifting::base_colors;
use super::sample::{files_below, json, write_source};
use super::schemas::breaches;

/// The sample's room with its input view alone, rendered by the built-in tracer.
static DATASET: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("delighting");
    let recipe = write_source(&folder.join("source"), "resolution = [96, 72]\natlas_size = 64\nviews = []", &["room"]);
    run(&mut build(&recipe, &folder.join("dataset"))).ends_with(0);
    run(&mut render_photos(&folder.join("dataset"), 64)).ends_with(0);
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
    assert_eq!(breaches("fitted_lights", &lights), Vec::<String>::new());
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
        run(baseline("median", &DATASET, &out).arg("--parts").args(words)).ends_with(0);
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

/// A scene without a photo, a photo of another size, a black one, and a place inside the dataset.
#[test]
fn bad_photos() {
    let folder = tempfile::tempdir().unwrap();
    let head = "resolution = [32, 24]\natlas_size = 64\nviews = []";
    let dataset = folder.path().join("dataset");
    run(&mut build(&write_source(&folder.path().join("source"), head, &["room"]), &dataset)).ends_with(0);
    let out = folder.path().join("pictures");
    let photo = dataset.join("scenes/room/views/input/rgb.exr");
    let write = |picture: &Picture<LinearRgb>| exr_io::write_linear(&photo, picture, Precision::Float).unwrap();

    delight(&dataset, &out, 2).ends_with(2).says("rgb.exr' does not exist").says("mateval prep render");
    write(&Picture::filled(8, 8, LinearRgb([0.5; 3])));
    delight(&dataset, &out, 2).ends_with(2).says("rgb.exr").says("not as large as scene.json says");
    assert!(!out.exists());

    write(&Picture::filled(32, 24, LinearRgb::default()));
    delight(&dataset, &out, 2).ends_with(0);
    let base_color = exr_io::read_linear(&out.join("room/base_color.exr")).unwrap();
    assert!(base_color.pixels().iter().flat_map(|pixel| pixel.0).all(|v| (0.0..=1.0).contains(&v)));

    delight(&dataset, &dataset.join("scenes/pictures"), 2).ends_with(2).says("would lie in the dataset");
    delight(&dataset, &out, 2).ends_with(2).says("exists");
}
