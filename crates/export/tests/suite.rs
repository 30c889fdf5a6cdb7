//! Exports of the built-in sample.

#![allow(
    clippy::unwrap_used,
    reason = "tests unwrap; clippy exempts only functions marked as tests, not what they call"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DMat4, DQuat, DVec2, DVec3};
use mateval_dataset::dataset::DatasetFile;
use mateval_dataset::manifest;
use mateval_dataset::open::DatasetId;
use mateval_dataset::open::{Dataset, chosen_ids};
use mateval_dataset::{Camera, DatasetError, SceneId, json};
use mateval_export::{ExportError, ExportOptions, Exported, Format, export};
use mateval_files::untrusted::{sha256_of_bytes, sha256_of_file};
use mateval_image::exr_io;
use mateval_testkit::packed::files;
use mateval_testkit::{copy_folder, sample_dataset};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::{ListAccessor as _, RowAccessor as _};
use serde_json::Value;

/// The folder of the sample; tests must not write to it.
fn root() -> &'static Path {
    &sample_dataset::dataset().root
}

/// A copy of the sample that a test may change.
fn copy() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_folder(root(), folder.path());
    folder
}

fn options(dataset: &Path, format: Format, out: PathBuf) -> ExportOptions {
    ExportOptions { dataset: dataset.to_owned(), format, out, publication: Default::default() }
}

/// Exports a dataset to `out` in a new folder.
fn exported(dataset: &Path, format: Format) -> (tempfile::TempDir, Result<Exported, ExportError>) {
    let folder = tempfile::tempdir().unwrap();
    let found = export(&options(dataset, format, folder.path().join("out")), &|_| ());
    (folder, found)
}

/// All formats.
const FORMATS: [Format; 5] = [Format::Tar, Format::Croissant, Format::Huggingface, Format::Nerfstudio, Format::Colmap];

fn unpack(tar: &Path, place: &Path) {
    tar::Archive::new(std::fs::File::open(tar).unwrap()).unpack(place).unwrap();
}

/// Times, modes and hidden files of the dataset's folder do not reach the tars.
#[test]
fn tars_depend_on_nothing_but_the_files() {
    let other = copy();
    std::fs::write(other.path().join(".hidden"), "x").unwrap();
    for (name, _) in files(other.path()) {
        let file = std::fs::File::options().write(true).open(other.path().join(name)).unwrap();
        file.set_modified(std::time::SystemTime::UNIX_EPOCH).unwrap();
    }
    let (first, _) = exported(root(), Format::Tar);
    let (second, found) = exported(other.path(), Format::Tar);
    assert_eq!(found.unwrap().scenes, 2);
    let names: Vec<String> = files(&first.path().join("out")).into_iter().map(|(name, _)| name).collect();
    let expected = "TARS.sha256 base.tar licences/living.txt licences/room.txt scenes/living.tar scenes/room.tar";
    assert_eq!(names.join(" "), expected);
    assert!(files(&first.path().join("out")) == files(&second.path().join("out")));
}

#[test]
fn headers_hold_nothing_of_the_machine_and_names_are_sorted() {
    let (folder, _) = exported(root(), Format::Tar);
    let mut seen = 0;
    for name in ["base.tar", "scenes/living.tar", "scenes/room.tar"] {
        let mut archive = tar::Archive::new(std::fs::File::open(folder.path().join("out").join(name)).unwrap());
        let mut names = Vec::new();
        for entry in archive.entries().unwrap() {
            let entry = entry.unwrap();
            let header = entry.header();
            assert_eq!(
                [header.mtime().unwrap(), header.uid().unwrap(), header.gid().unwrap(), header.mode().unwrap().into()],
                [0, 0, 0, 0o644]
            );
            assert_eq!(header.entry_type(), tar::EntryType::Regular);
            names.push(entry.path().unwrap().to_str().unwrap().to_owned());
        }
        assert!(names.is_sorted(), "{names:?}");
        seen += names.len();
    }
    assert_eq!(seen, manifest::entries(root()).unwrap().len() + 2);
}

#[test]
fn unpacked_tars_are_the_dataset() {
    let (folder, _) = exported(root(), Format::Tar);
    let (out, place) = (folder.path().join("out"), folder.path().join("again"));
    for line in std::fs::read_to_string(out.join("TARS.sha256")).unwrap().lines() {
        let (sha256, name) = line.split_once("  ").unwrap();
        assert_eq!(sha256_of_file(&out.join(name)).unwrap(), sha256);
        unpack(&out.join(name), &place);
    }
    // What `prep` keeps for itself does not travel.
    let of_dataset = |root: &Path| {
        let mut files = files(root);
        files.retain(|(name, _)| !name.starts_with(".build"));
        files
    };
    assert!(of_dataset(&place) == of_dataset(root()));
}

#[test]
fn the_base_and_one_scene_open() {
    let (folder, _) = exported(root(), Format::Tar);
    let (out, place) = (folder.path().join("out"), folder.path().join("part"));
    unpack(&out.join("base.tar"), &place);
    assert_eq!(Dataset::open(&place).unwrap().absent.len(), 2);
    unpack(&out.join("scenes/room.tar"), &place);
    let dataset = Dataset::open(&place).unwrap();
    assert_eq!(dataset.scenes.iter().map(|scene| scene.id.as_str()).collect::<Vec<_>>(), ["room"]);
    dataset.check_files(&dataset.scenes[0].id, |_| true).unwrap();
}

#[test]
fn rows_of_the_parquet_file_are_the_views() {
    let (folder, found) = exported(root(), Format::Huggingface);
    assert_eq!((found.unwrap().views, sample_dataset::dataset().scenes.len()), (Some(10), 2));
    let path = folder.path().join("out/data/test-00000-of-00001.parquet");
    let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    assert_eq!(reader.num_row_groups(), 2);
    let mut rows = reader.get_row_iter(None).unwrap();
    for scene in &sample_dataset::dataset().scenes {
        for view in &scene.views {
            let row = rows.next().unwrap().unwrap();
            let ids = [row.get_string(0).unwrap().as_str(), row.get_string(1).unwrap()];
            assert_eq!(ids, [scene.id.as_str(), view.id.as_str()]);
            let renderer = sample_dataset::dataset().file.photo_renderer.as_ref().unwrap();
            let picture = sample_dataset::dataset().folder(&scene.id).render(renderer, &view.id).join("rgb.png");
            let bytes = row.get_group(2).unwrap().get_bytes(0).unwrap();
            assert!(bytes.data() == std::fs::read(picture).unwrap());
            let lens = row.get_group(3).unwrap();
            assert_eq!(lens.get_int(0).unwrap() as u32, view.camera.intrinsics.width);
            assert_eq!(lens.get_double(5).unwrap(), view.camera.intrinsics.cy);
            let matrix = row.get_list(4).unwrap();
            let number = |at: usize, column: usize| matrix.get_list(at).unwrap().get_double(column).unwrap();
            let found: [[f64; 4]; 4] = std::array::from_fn(|at| std::array::from_fn(|column| number(at, column)));
            assert_eq!((matrix.len(), found), (4, view.camera.world_from_camera));
        }
    }
    assert!(rows.next().is_none());
}

#[test]
fn the_description_lists_the_tars_with_their_hashes() {
    let (folder, _) = exported(root(), Format::Croissant);
    let out = folder.path().join("out");
    let text = std::fs::read_to_string(out.join("croissant.json")).unwrap();
    let description: Value = serde_json::from_str(&text).unwrap();
    let objects = description["distribution"].as_array().unwrap().iter().filter(|object| object["sha256"].is_string());
    let objects: Vec<&Value> = objects.collect();
    assert_eq!(objects.len(), 4);
    for object in objects {
        let name = object["contentUrl"].as_str().unwrap();
        assert_eq!(sha256_of_file(&out.join(name)).unwrap(), object["sha256"].as_str().unwrap());
    }
    assert_eq!(std::fs::read_to_string(out.join("views.jsonl")).unwrap().lines().count(), 10);
}

/// How far a point may be from its place, in pixels.
const TOLERANCE: f64 = 1e-6;

/// Points on the surfaces that a view shows, and their places in its picture.
fn points(scene: usize, view: usize) -> Vec<(DVec3, DVec2)> {
    let dataset = sample_dataset::dataset();
    let (scene, view) = (&dataset.scenes[scene], &dataset.scenes[scene].views[view]);
    let depth = exr_io::read_scalar(&dataset.folder(&scene.id).view(&view.id).join("depth.exr")).unwrap();
    let pixels = (0..depth.width() * depth.height()).map(|at| (at % depth.width(), at / depth.width()));
    let hit = pixels.filter(|&(x, y)| depth.get(x, y) > 0.0);
    hit.map(|(x, y)| {
        let pixel = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        (view.camera.unproject(pixel, f64::from(depth.get(x, y))), pixel)
    })
    .collect()
}

/// Compares a projection with the places of all points of every view.
fn compare(project: impl Fn(usize, usize, DVec3) -> DVec2) {
    let mut seen = 0;
    for (at, scene) in sample_dataset::dataset().scenes.iter().enumerate() {
        for view in 0..scene.views.len() {
            for (point, pixel) in points(at, view) {
                let found = project(at, view, point);
                assert!(found.distance(pixel) < TOLERANCE, "{found} instead of {pixel}");
                seen += 1;
            }
        }
    }
    assert!(seen > 20_000, "only {seen} points seen");
}

/// The projection that nerfstudio documents: OpenGL's axes, `fl_x`, `fl_y`, `cx`, `cy` in pixels.
#[test]
fn transforms_json_projects_the_points_to_their_pixels() {
    let (folder, _) = exported(root(), Format::Nerfstudio);
    let files: Vec<Value> = sample_dataset::dataset()
        .scenes
        .iter()
        .map(|scene| {
            let path = folder.path().join("out").join(scene.id.as_str()).join("transforms.json");
            serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
        })
        .collect();
    for (file, scene) in files.iter().zip(&sample_dataset::dataset().scenes) {
        let frames = file["frames"].as_array().unwrap();
        assert_eq!(frames.len(), scene.views.len());
        assert!(file.get("applied_transform").is_none());
        for key in ["file_path", "depth_file_path"] {
            let all = frames.iter().map(|frame| frame[key].as_str().unwrap());
            assert!(
                all.map(|name| folder.path().join("out").join(scene.id.as_str()).join(name)).all(|path| path.is_file())
            );
        }
    }
    compare(|scene, view, point| {
        let file = &files[scene];
        let number = |key: &str| file[key].as_f64().unwrap();
        let rows: [[f64; 4]; 4] = serde_json::from_value(file["frames"][view]["transform_matrix"].clone()).unwrap();
        let camera = DMat4::from_cols_array_2d(&rows).transpose().inverse().transform_point3(point);
        let (x, y) = (camera.x / -camera.z, camera.y / -camera.z);
        DVec2::new(number("cx") + number("fl_x") * x, number("cy") - number("fl_y") * y)
    });
}

/// COLMAP's text model, parsed by its documentation.
struct Model {
    /// fx, fy, cx, cy by id.
    cameras: BTreeMap<usize, [f64; 4]>,
    /// In the order of the file.
    images: Vec<Image>,
    /// By id.
    points: BTreeMap<usize, DVec3>,
    tracks: BTreeMap<usize, Vec<(usize, usize)>>,
}

struct Image {
    id: usize,
    turn: DQuat,
    shift: DVec3,
    camera: usize,
    name: String,
    points: Vec<(DVec2, usize)>,
}

fn numbers(words: &[&str]) -> Vec<f64> {
    words.iter().map(|word| word.parse().unwrap()).collect()
}

impl Model {
    fn read(folder: &Path) -> Self {
        let lines = |name: &str| -> Vec<String> {
            let text = std::fs::read_to_string(folder.join(name)).unwrap();
            text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
        };
        let mut model =
            Self { cameras: BTreeMap::new(), images: Vec::new(), points: BTreeMap::new(), tracks: BTreeMap::new() };
        for line in lines("cameras.txt") {
            let words: Vec<&str> = line.split(' ').collect();
            assert_eq!(words[1], "PINHOLE");
            model.cameras.insert(words[0].parse().unwrap(), numbers(&words[4..]).try_into().unwrap());
        }
        for pair in lines("images.txt").chunks(2) {
            let words: Vec<&str> = pair[0].split(' ').collect();
            let pose = numbers(&words[1..8]);
            let places: Vec<&str> = pair[1].split_whitespace().collect();
            let point = |words: &[&str]| (DVec2::from_slice(&numbers(&words[..2])), words[2].parse().unwrap());
            model.images.push(Image {
                id: words[0].parse().unwrap(),
                turn: DQuat::from_xyzw(pose[1], pose[2], pose[3], pose[0]),
                shift: DVec3::from_slice(&pose[4..]),
                camera: words[8].parse().unwrap(),
                name: words[9].to_owned(),
                points: places.chunks(3).map(point).collect(),
            });
        }
        for line in lines("points3D.txt") {
            let words: Vec<&str> = line.split(' ').collect();
            let id = words[0].parse().unwrap();
            model.points.insert(id, DVec3::from_slice(&numbers(&words[1..4])));
            let track = words[8..].chunks(2).map(|pair| (pair[0].parse().unwrap(), pair[1].parse().unwrap()));
            model.tracks.insert(id, track.collect());
        }
        model
    }

    fn project(&self, image: &Image, point: DVec3) -> DVec2 {
        let camera = image.turn * point + image.shift;
        let [fx, fy, cx, cy] = self.cameras[&image.camera];
        DVec2::new(cx + fx * camera.x / camera.z, cy + fy * camera.y / camera.z)
    }
}

fn models(folder: &Path) -> Vec<Model> {
    let scenes = &sample_dataset::dataset().scenes;
    scenes.iter().map(|scene| Model::read(&folder.join("out").join(scene.id.as_str()).join("sparse/0"))).collect()
}

#[test]
fn colmap_projects_the_points_to_their_pixels() {
    let (folder, _) = exported(root(), Format::Colmap);
    let models = models(folder.path());
    compare(|scene, view, point| models[scene].project(&models[scene].images[view], point));
}

#[test]
fn colmaps_points_are_where_its_pictures_show_them() {
    let (folder, _) = exported(root(), Format::Colmap);
    for (model, scene) in models(folder.path()).iter().zip(&sample_dataset::dataset().scenes) {
        assert!((500..=2000).contains(&model.points.len()), "{} points", model.points.len());
        let names: Vec<String> = scene.views.iter().map(|view| format!("{}.png", view.id)).collect();
        assert_eq!(model.images.iter().map(|image| &image.name).collect::<Vec<_>>(), names.iter().collect::<Vec<_>>());
        let mut observations = 0;
        for image in &model.images {
            assert!(folder.path().join("out").join(scene.id.as_str()).join("images").join(&image.name).is_file());
            for (at, (pixel, point)) in image.points.iter().enumerate() {
                assert!(model.project(image, model.points[point]).distance(*pixel) < TOLERANCE);
                assert!(model.tracks[point].contains(&(image.id, at)));
                observations += 1;
            }
        }
        assert_eq!(observations, model.tracks.values().map(Vec::len).sum::<usize>());
        assert!(observations > 2 * model.points.len(), "{observations} observations");
    }
}

/// The twin: a pixel's centre at a whole number, another convention, would be found.
#[test]
fn half_a_pixel_is_more_than_the_tolerance() {
    let camera: &Camera = &sample_dataset::dataset().scenes[0].views[0].camera;
    let (point, pixel) = points(0, 0)[0];
    assert!((camera.project(point).unwrap().0 - DVec2::splat(0.5)).distance(pixel) > TOLERANCE);
}

#[test]
fn every_export_holds_the_licences() {
    // The house's licence is that of the recipe, which this copy lacks.
    let copy = copy();
    let path = copy.path().join("dataset.json");
    let mut file: DatasetFile = json::read(&path).unwrap();
    file.licences.retain(|licence| licence.file != "recipe.toml");
    json::write(&path, &file).unwrap();
    let [licence] = &file.licences[..] else { panic!("{:?}", file.licences) };
    assert_eq!((licence.scene.as_str(), licence.file.as_str()), ("room", "LICENSE.txt"));
    for format in FORMATS {
        let (folder, _) = exported(copy.path(), format);
        let out = folder.path().join("out");
        let (place, other) = match format {
            Format::Nerfstudio | Format::Colmap => ("room/LICENCE.txt", "living/LICENCE.txt"),
            _ => ("licences/room.txt", "licences/living.txt"),
        };
        let text = std::fs::read_to_string(out.join(place)).unwrap();
        assert_eq!(text, format!("LICENSE.txt:\n\n{}\n", licence.text.trim_end()));
        assert!(!out.join(other).exists());
        // Beside the file, descriptions of views state it too.
        let start = "This is the Mitsuba version of 'The Sample Room'";
        assert!(licence.text.starts_with(start));
        let stating = match format {
            Format::Croissant => vec!["croissant.json", "views.jsonl"],
            Format::Huggingface => vec!["README.md", "data/test-00000-of-00001.parquet"],
            _ => Vec::new(),
        };
        let all = files(&out);
        let holds = |name: &str, text: &str| {
            let (_, bytes) = all.iter().find(|(file, _)| file == name).unwrap();
            bytes.windows(text.len()).any(|window| window == text.as_bytes())
        };
        for name in stating {
            assert!(holds(name, start), "{name}");
            // Those of the whole dataset say what the other scene lacks.
            let is_whole = ["croissant.json", "README.md"].contains(&name);
            assert_eq!(holds(name, "for 1 of the 2 scenes, 'living' first; data of 3D-FRONT"), is_whole, "{name}");
        }
    }
}

/// The twin: the recipe states the licence that the source lacks.
#[test]
fn nothing_is_said_where_every_scene_has_a_licence() {
    for (format, name) in [(Format::Croissant, "croissant.json"), (Format::Huggingface, "README.md")] {
        let (folder, _) = exported(root(), format);
        let text = std::fs::read_to_string(folder.path().join("out").join(name)).unwrap();
        assert!(text.contains("CC0-1.0") && !text.contains("no licence is stated"), "{text}");
    }
}

fn id(text: &str) -> SceneId {
    SceneId::new(text).unwrap()
}

#[test]
fn an_absent_scene_is_named_where_it_is_needed() {
    let folder = copy();
    std::fs::remove_dir_all(folder.path().join("scenes/living")).unwrap();
    let dataset = Dataset::open(folder.path()).unwrap();
    assert_eq!(dataset.absent, [id("living")]);
    assert_eq!(dataset.chosen_scenes(&[]).unwrap().len(), 1);
    let absence = dataset.absence().unwrap();
    assert!(absence.starts_with("1 of the 2 scenes of '"), "{absence}");
    let expected = "/dataset.json' lists are missing: unpack 'scenes/living.tar' in the dataset's folder";
    for error in [
        dataset.scene(&id("living")).unwrap_err(),
        dataset.check_whole().unwrap_err(),
        // What rewrites the manifest would drop the absent scene's lines.
        chosen_ids(folder.path(), &dataset.file, &[id("room")]).unwrap_err(),
    ] {
        let text = error.to_string();
        assert!(text.starts_with("the folders of 1 of the 2 scenes that '") && text.ends_with(expected), "{text}");
    }
    // Results state that they are partial.
    let stated = DatasetId::new(&dataset, &dataset.scenes);
    assert_eq!((stated.scenes, stated.total_scenes), (vec![id("room")], 2));
}

#[test]
fn without_any_scene_nothing_can_be_chosen() {
    let folder = copy();
    std::fs::remove_dir_all(folder.path().join("scenes")).unwrap();
    let dataset = Dataset::open(folder.path()).unwrap();
    assert!(dataset.scenes.is_empty());
    let text = dataset.chosen_scenes(&[]).unwrap_err().to_string();
    assert!(text.contains("'scenes/living.tar', 'scenes/room.tar'"), "{text}");
}

/// A scene that the manifest does not list was never part of the dataset.
#[test]
fn a_scene_that_only_dataset_json_lists_is_a_fault() {
    let folder = copy();
    let path = folder.path().join("dataset.json");
    let mut file: DatasetFile = json::read(&path).unwrap();
    file.scenes.push(id("attic"));
    json::write(&path, &file).unwrap();
    let text = Dataset::open(folder.path()).unwrap_err().to_string();
    assert!(text.contains("scenes/attic/scene.json"), "{text}");
}

/// The twin: a scene is there as a whole or not at all.
#[test]
fn a_scene_that_is_half_there_is_refused() {
    let folder = copy();
    std::fs::remove_file(folder.path().join("scenes/living/scene.json")).unwrap();
    let text = Dataset::open(folder.path()).unwrap_err().to_string();
    assert!(text.contains("scenes/living/scene.json"), "{text}");
}

#[test]
fn formats_of_the_whole_dataset_need_all_scenes() {
    let folder = copy();
    std::fs::remove_dir_all(folder.path().join("scenes/living")).unwrap();
    for format in [Format::Tar, Format::Croissant, Format::Huggingface] {
        let text = exported(folder.path(), format).1.unwrap_err().to_string();
        assert!(text.starts_with("the folders of 1 of the 2 scenes"), "{text}");
    }
    for format in [Format::Nerfstudio, Format::Colmap] {
        assert_eq!(exported(folder.path(), format).1.unwrap().scenes, 1);
    }
}

/// The code of a finding, and a change that causes it.
type Change = (&'static str, fn(&std::path::Path));

/// Makes the manifest and `dataset.json` agree with the files again.
fn renew(root: &std::path::Path, text: Option<String>) {
    let sha256 = match text {
        Some(text) => {
            std::fs::write(root.join("MANIFEST.sha256"), &text).unwrap();
            sha256_of_bytes(text.as_bytes())
        }
        None => manifest::write(root).unwrap(),
    };
    let path = root.join("dataset.json");
    let mut file: DatasetFile = json::read(&path).unwrap();
    file.manifest_sha256 = sha256;
    json::write(&path, &file).unwrap();
}

#[test]
fn changed_missing_and_unlisted_files() {
    let changes: [Change; 3] = [
        ("changed_file", |root| std::fs::write(root.join("scenes/room/views/input/rgb.png"), "x").unwrap()),
        ("missing_file", |root| std::fs::remove_file(root.join("scenes/room/geometry/parts.glb")).unwrap()),
        ("unlisted_file", |root| std::fs::write(root.join("scenes/room/.DS_Store"), "x").unwrap()),
    ];
    for (code, change) in changes {
        let folder = copy();
        change(folder.path());
        for format in FORMATS {
            let (out, found) = exported(folder.path(), format);
            let Err(ExportError::Dataset(DatasetError::Invalid { findings, .. })) = found else { panic!("{found:?}") };
            assert_eq!(findings.iter().map(|finding| finding.code.as_str()).collect::<Vec<_>>(), [code]);
            assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 0);
        }
    }
}

#[test]
fn hidden_files_even_if_they_are_listed() {
    let folder = copy();
    std::fs::write(folder.path().join("scenes/room/.secret"), "x").unwrap();
    renew(folder.path(), None);
    let text = exported(folder.path(), Format::Tar).1.unwrap_err().to_string();
    assert!(text.contains("lists 1 hidden files ('scenes/room/.secret' first), which are never exported"), "{text}");
}

/// A manifest that lists a file outside the dataset, with its right hash.
#[test]
fn names_that_lead_out_of_the_dataset() {
    let above = tempfile::tempdir().unwrap();
    let inside = above.path().join("dataset");
    mateval_testkit::copy_folder(root(), &inside);
    std::fs::write(above.path().join("secret"), "x").unwrap();
    let absolute = above.path().join("secret").to_str().unwrap().to_owned();
    let listed = std::fs::read_to_string(inside.join("MANIFEST.sha256")).unwrap();
    for name in ["../secret", "scenes/../../secret", absolute.as_str()] {
        let line = format!("{}  {name}\n", sha256_of_bytes(b"x"));
        renew(&inside, Some(format!("{listed}{line}")));
        for format in FORMATS {
            let (out, found) = exported(&inside, format);
            let text = found.unwrap_err().to_string();
            assert!(text.contains("bad_manifest_line"), "{text}");
            assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 0);
        }
    }
}

#[test]
fn outputs_that_exist_or_lie_in_the_dataset() {
    let folder = copy();
    let inside = options(folder.path(), Format::Tar, folder.path().join("scenes/out"));
    assert!(matches!(export(&inside, &|_| ()), Err(ExportError::Dataset(DatasetError::OutputInDataset { .. }))));
    let place = tempfile::tempdir().unwrap();
    let taken = options(folder.path(), Format::Tar, place.path().to_owned());
    let text = export(&taken, &|_| ()).unwrap_err().to_string();
    assert!(text.ends_with("already exists; choose another --out, or remove it"), "{text}");
}

#[test]
fn pictures_that_were_not_rendered() {
    let folder = copy();
    let path = folder.path().join("dataset.json");
    let mut file: DatasetFile = json::read(&path).unwrap();
    file.photo_renderer = None;
    json::write(&path, &file).unwrap();
    for format in FORMATS {
        let found = exported(folder.path(), format).1;
        match format {
            Format::Tar => assert!(found.is_ok()),
            _ => assert!(matches!(found, Err(ExportError::NoPictures { .. })), "{found:?}"),
        }
    }
}

/// A copy without its ground truth is whole; only the pictures of novel views are missing.
#[test]
fn withheld_truth_is_no_fault() {
    let folder = copy();
    for scene in ["living", "room"] {
        std::fs::remove_dir_all(folder.path().join("scenes").join(scene).join("ground_truth")).unwrap();
    }
    for format in FORMATS {
        let found = exported(folder.path(), format).1.unwrap();
        let expected = match format {
            Format::Tar => (None, 0),
            Format::Croissant | Format::Huggingface => (Some(10), 8),
            Format::Nerfstudio | Format::Colmap => (Some(2), 8),
        };
        assert_eq!((found.views, found.without_picture), expected, "{format:?}");
    }
}
