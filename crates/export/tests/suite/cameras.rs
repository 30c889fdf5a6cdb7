//! The exported cameras show each point of the dataset where the dataset's own cameras show it.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat4, DQuat, DVec2, DVec3};
use mateval_export::Format;
use mateval_image::exr_io;
use mateval_scene::Camera;
use mateval_testkit::sample_dataset;
use serde_json::Value;

use super::sample::{exported, root};

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
