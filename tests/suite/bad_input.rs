//! Bad input: an error with the path and exit code 2 if the job cannot be done, a finding if it can. The program never
//! crashes and never leaves a half-written file in the place of a finished one.

use std::path::{Path, PathBuf};

use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture};

use super::command::{Run, baseline, build, mateval, render, run, score, stats, verify};
use super::sample::{copied_dataset, files_below, json, unrendered, write_source};

/// The head of a recipe with the input view alone and the smallest sizes.
const TINY: &str = "resolution = [32, 24]\natlas_size = 64\nviews = []";

/// A copy of the sample's source for a test to damage, and the place of its dataset.
struct Source {
    folder: tempfile::TempDir,
    recipe: PathBuf,
}

impl Source {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let recipe = write_source(&folder.path().join("source"), TINY, &["room"]);
        Self { folder, recipe }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join("source/room").join(name)
    }

    fn edit(&self, name: &str, change: impl FnOnce(String) -> String) {
        let text = std::fs::read_to_string(self.file(name)).unwrap();
        let changed = change(text.clone());
        assert_ne!(changed, text, "nothing was changed in {name}");
        std::fs::write(self.file(name), changed).unwrap();
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("dataset")
    }

    fn build(&self) -> Run {
        run(&mut build(&self.recipe, &self.out()))
    }

    /// Expects a sound dataset with a finding on stderr and in scene.json that has this code and file.
    #[track_caller]
    fn gives_finding(&self, code: &str, file: &str, message: &str) {
        let warning = format!("room: warning [{code}] '{file}'");
        self.build().ends_with(0).says(&warning).says(message);
        let scene = json(&self.out().join("scenes/room/scene.json"));
        let findings = scene["findings"].as_array().unwrap();
        assert!(findings.iter().any(|finding| finding["code"] == code && finding["file"] == file), "{findings:?}");
        run(&mut verify(&self.out())).ends_with(0);
    }

    /// Expects that the scene is refused with this finding as the cause. From then on, the recipe allows it.
    #[track_caller]
    fn is_refused_until_allowed(&self, key: &str, code: &str) {
        let refused = self.build().ends_with(2);
        refused.says(&format!("`{key} = true`")).says(&format!("[{code}]"));
        let text = std::fs::read_to_string(&self.recipe).unwrap();
        std::fs::write(&self.recipe, format!("{text}\n{key} = true\n")).unwrap();
    }

    /// Expects that nothing is made and that the error names the path.
    #[track_caller]
    fn gives_error(&self, parts: &[&str]) {
        let refused = self.build().ends_with(2);
        assert_eq!(refused.stdout, "");
        assert!(!self.out().join("dataset.json").exists() && !self.out().join("MANIFEST.sha256").exists());
        for part in parts {
            assert!(refused.error().contains(part), "'{part}' not in {}", refused.stderr);
        }
    }
}

/// The twin of all tests below: an undamaged source has no warnings.
#[test]
fn the_whole_sample_has_no_findings() {
    let built = Source::new().build().ends_with(0);
    assert!(!built.stderr.contains("warning") && built.error().is_empty(), "{}", built.stderr);
}

#[test]
fn a_truncated_texture() {
    let source = Source::new();
    let path = source.file("textures/planks.png");
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    source.is_refused_until_allowed("allow_unstated", "unreadable_texture");
    source.gives_finding("unreadable_texture", "textures/planks.png", "planks.png");
}

#[test]
fn a_texture_of_a_hundred_thousand_squared() {
    let source = Source::new();
    let path = source.file("textures/planks.png");
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[16..20].copy_from_slice(&100_000_u32.to_be_bytes());
    bytes[20..24].copy_from_slice(&100_000_u32.to_be_bytes());
    let check = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&check.to_be_bytes());
    std::fs::write(&path, bytes).unwrap();
    source.is_refused_until_allowed("allow_unstated", "unreadable_texture");
    source.gives_finding("unreadable_texture", "textures/planks.png", "100000x100000");
}

/// The CRC of PNG's chunks (PNG specification, annex D).
fn crc32(bytes: &[u8]) -> u32 {
    let shift = |crc: u32| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), |crc, _| shift(crc)))
}

#[test]
fn a_texture_that_holds_nan() {
    let source = Source::new();
    let mut picture = Picture::filled(8, 8, LinearRgb([0.5; 3]));
    picture.set(3, 2, LinearRgb([0.5, f32::NAN, 0.5]));
    exr_io::write_linear(&source.file("textures/planks.exr"), &picture, Precision::Float).unwrap();
    source.edit("scene.xml", |text| text.replace("planks.png", "planks.exr"));
    source.is_refused_until_allowed("allow_unstated", "unreadable_texture");
    source.gives_finding("unreadable_texture", "textures/planks.exr", "pixel (3, 2) is NaN or infinite");
}

#[test]
fn an_obj_with_an_index_out_of_range() {
    let source = Source::new();
    source.edit("models/rug.obj", |text| text + "f 999999 1 2\n");
    source.gives_finding("bad_mesh", "models/rug.obj", "");
}

#[test]
fn a_missing_model() {
    let source = Source::new();
    std::fs::remove_file(source.file("models/rug.obj")).unwrap();
    source.gives_finding("missing_file", "models/rug.obj", "left the shape out");
}

#[test]
fn xml_nested_ten_thousand_deep() {
    let source = Source::new();
    let deep = format!("<scene version=\"3.0.0\">{}{}</scene>", "<bsdf>".repeat(10_000), "</bsdf>".repeat(10_000));
    std::fs::write(source.file("scene.xml"), deep).unwrap();
    source.gives_error(&["scene.xml"]);
}

#[test]
fn xml_that_ends_early_is_none_or_is_binary() {
    let source = Source::new();
    source.edit("scene.xml", |text| text[..text.len() / 2].to_owned());
    source.gives_error(&["scene.xml"]);
    std::fs::write(source.file("scene.xml"), "").unwrap();
    source.gives_error(&["scene.xml"]);
    std::fs::write(source.file("scene.xml"), [0xff, 0x00, 0xfe, 0x3c]).unwrap();
    source.gives_error(&["scene.xml"]);
}

#[test]
fn a_recipe_that_names_a_missing_scene() {
    let source = Source::new();
    std::fs::remove_file(source.file("scene.xml")).unwrap();
    source.gives_error(&["recipe.toml", "scene 'room': there is no file", "room/scene.xml", "--source"]);
    assert!(!source.out().exists(), "an early failure must leave no output");
}

#[test]
fn a_recipe_with_unknown_words_or_none() {
    let source = Source::new();
    let text = std::fs::read_to_string(&source.recipe).unwrap();
    std::fs::write(&source.recipe, text.replace("resolution", "resolutoin")).unwrap();
    source.gives_error(&["recipe.toml", "resolutoin"]);
    std::fs::write(&source.recipe, [0xff, 0xfe]).unwrap();
    source.gives_error(&["recipe.toml"]);
    std::fs::remove_file(&source.recipe).unwrap();
    source.gives_error(&["recipe.toml"]);
    assert!(!source.out().exists());
}

#[test]
fn a_folder_that_is_no_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let (none, out) = (folder.path().join("none"), folder.path().join("out"));
    std::fs::create_dir(&none).unwrap();
    std::fs::write(none.join("notes.txt"), "mine").unwrap();
    let commands = [
        verify(&none),
        stats(&none),
        render(&none, 1),
        baseline("gt", &none, &out),
        baseline("grey", &none, &out),
        score(&none, &none, &out),
    ];
    for mut command in commands {
        let refused = run(&mut command).ends_with(2);
        assert!(refused.error().contains("none") && refused.error().contains("dataset.json"), "{}", refused.stderr);
        assert_eq!(refused.stdout, "");
    }
    assert_eq!(files_below(folder.path()), [Path::new("none/notes.txt")]);
}

/// Builds the room with this camera and these views.
fn built_from(camera: &str, views: &str) -> Run {
    let source = Source::new();
    let text = std::fs::read_to_string(&source.recipe).unwrap();
    std::fs::write(&source.recipe, format!("{}camera = {camera}\n", text.replace("views = []", views))).unwrap();
    let built = source.build();
    assert_eq!(built.code == Some(0), source.out().join("dataset.json").exists());
    if built.code == Some(0) {
        run(&mut verify(&source.out())).ends_with(0);
    }
    built
}

/// If the input view shows nothing to score, the scene is refused; for another view it is a finding.
#[test]
fn cameras_that_see_nothing() {
    let away = "{ position = [2.0, 1.5, 20.0], target = [2.0, 1.5, 30.0], fov_y_deg = 40.0 }";
    let refused = built_from(away, "views = []").ends_with(2);
    refused.says("scene 'room': the camera sees nothing that is scored").says("in the input view");
    let towards = "{ position = [2.0, 1.5, 20.0], target = [2.0, 1.5, 2.0], fov_y_deg = 40.0 }";
    let turned = "views = [{ id = \"behind\", x_deg = 0.0, y_deg = 180.0 }]";
    let built = built_from(towards, turned).ends_with(0);
    let warning = "warning [nothing_seen] 'scene.xml' view 'behind': the camera sees nothing that is scored";
    built.says(warning);
    // The twin.
    assert!(!built_from(towards, "views = []").ends_with(0).stderr.contains("nothing_seen"));
}

/// Half a millimetre above the floor, where unwrapping once aborted the program for lack of a fixed atlas size.
#[test]
fn a_camera_that_is_too_near() {
    let above =
        |height: f64| format!("{{ position = [2.0, {height}, 2.0], target = [1.0, {height}, 1.0], fov_y_deg = 60.0 }}");
    // There it stands inside the rug, which no light reaches.
    let refused = built_from(&above(0.000_2), "views = []").ends_with(2);
    refused
        .says("its picture would be black")
        .says("warning [camera_too_near] 'scene.xml' view 'input': a surface is ");
    // The twin.
    assert!(!built_from(&above(0.1), "views = []").ends_with(0).stderr.contains("camera_too_near"));
}

/// Nothing is overwritten without `--force`; with it, only outputs of the same kind are.
#[test]
fn outputs_that_exist() {
    let source = Source::new();
    std::fs::create_dir(source.out()).unwrap();
    std::fs::write(source.out().join("notes.txt"), "mine").unwrap();
    let out = source.out();
    for words in [&[][..], &["--force"]] {
        run(build(&source.recipe, &out).args(words)).ends_with(2).says("is not a dataset");
        run(baseline("grey", unrendered(), &out).args(words)).ends_with(2).says("dataset'");
    }
    run(mateval().arg("sample").arg(&out)).ends_with(2).says("already exists");
    assert_eq!(files_below(&out), [Path::new("notes.txt")]);

    let result = out.join("RESULT.json");
    std::fs::write(&result, "mine").unwrap();
    let submission = out.join("grey");
    run(&mut baseline("grey", unrendered(), &submission)).ends_with(0);
    run(&mut baseline("grey", unrendered(), &submission)).ends_with(2).says("already exists").says("--force");
    run(&mut score(&submission, unrendered(), &result)).ends_with(2).says("already exists").says("--force");
    assert_eq!(std::fs::read_to_string(&result).unwrap(), "mine");
    run(score(&submission, unrendered(), &result).arg("--force")).ends_with(0);
    assert!(json(&result).is_object());
}

/// Scoring on a damaged dataset fails: the error names the file, and no result is written.
#[test]
fn a_dataset_with_a_truncated_picture() {
    let copy = copied_dataset();
    let folder = tempfile::tempdir().unwrap();
    let submission = folder.path().join("grey");
    run(&mut baseline("grey", copy.path(), &submission)).ends_with(0);
    let albedo = copy.path().join("scenes/room/ground_truth/views/up_left/albedo.exr");
    std::fs::write(&albedo, &std::fs::read(&albedo).unwrap()[..500]).unwrap();
    let result = folder.path().join("RESULT.json");
    run(&mut score(&submission, copy.path(), &result)).ends_with(2).says("up_left/albedo.exr");
    assert!(!result.exists());
}

/// Every reader of results refuses a key that it does not know and names its place. The twin is the result as published.
#[test]
fn a_result_with_an_unknown_key() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let published = include_str!("../../dataset_spec/examples/result.json");
    let changed = published.replacen("\"albedo.input.mse\"", "\"albedo.input.mze\"", 1);
    assert_ne!(changed, published);
    std::fs::write(path("published.json"), published).unwrap();
    std::fs::write(path("changed.json"), changed).unwrap();
    run(mateval().args(["eval", "tables"]).arg(path("published.json"))).ends_with(0);
    for words in [
        &["tables", "changed.json"][..],
        &["leaderboard", "changed.json", "--out", "site"],
        &["explain", "changed.json", "--scene", "room", "--dataset", "dataset", "--submission", "submission"],
    ] {
        let refused = run(mateval().current_dir(folder.path()).arg("eval").args(words)).ends_with(2);
        refused.says("'albedo.input.mze' is not a key of a result").says("/protocols/mateval-3/summary");
    }
    assert!(!path("site").exists());
}
