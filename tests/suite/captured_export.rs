//! `prep export` to nerfstudio and COLMAP and back is the identity: read as the cameras of a capture, the exports give
//! the dataset's own cameras.

use std::path::Path;

use glam::DVec3;
use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::lens::Lens;
use mateval_dataset::open::Dataset;
use mateval_sources::capture::cameras::CapturedCamera;
use mateval_sources::capture::{self, CaptureFiles};

use super::command::{mateval, run};
use super::sample::{dataset, json};

/// Both formats write the shortest digits that give the same number again. What is left is the rounding of rotations.
const SLACK: f64 = 1e-12;
/// How far the twin's camera is moved, in metres.
const MOVE_M: f64 = 1e-6;

/// The cameras of a scene's export at `root`, in the order of the scene's views.
fn read_back(root: &Path, cameras: &str, scene: &SceneFile) -> Vec<CapturedCamera> {
    let names: Vec<String> = scene.views.iter().map(|view| view.id.to_string()).collect();
    let files = CaptureFiles {
        root: root.to_owned(),
        mesh: "mesh.glb".to_owned(),
        cameras: cameras.to_owned(),
        photos: "images".to_owned(),
        input: names[0].clone(),
        novel: names[1..].to_vec(),
        labels: None,
        scale: 1.0,
        up: DVec3::Y,
        architecture: Vec::new(),
    };
    let read = capture::read(&files).unwrap();
    std::iter::once(read.input).chain(read.novel).map(|(_, camera)| camera).collect()
}

/// The largest difference between the axes of both cameras, or their distance in metres if that is larger.
fn deviation(camera: &CapturedCamera, view: &View) -> f64 {
    let axes = (camera.rotation - view.camera.rotation()).to_cols_array();
    let turned = axes.iter().fold(0.0_f64, |most, off| most.max(off.abs()));
    turned.max(camera.position.distance(view.camera.position()))
}

/// Changes the place of the input view in `transforms.json`.
fn move_in_transforms(root: &Path) {
    let path = root.join("transforms.json");
    let mut transforms = json(&path);
    let x = transforms["frames"][0]["transform_matrix"][0][3].as_f64().unwrap();
    transforms["frames"][0]["transform_matrix"][0][3] = (x + MOVE_M).into();
    std::fs::write(path, transforms.to_string()).unwrap();
}

/// Changes the translation of the input view in `images.txt`.
fn move_in_images(root: &Path) {
    let path = root.join("sparse/0/images.txt");
    let text = std::fs::read_to_string(&path).unwrap();
    let line = text.lines().find(|line| line.ends_with(" input.png")).unwrap();
    let mut words: Vec<String> = line.split(' ').map(str::to_owned).collect();
    words[5] = (words[5].parse::<f64>().unwrap() + MOVE_M).to_string();
    std::fs::write(path, text.replace(line, &words.join(" "))).unwrap();
}

#[test]
fn exports_read_as_captures_have_the_cameras_of_the_dataset() {
    let opened = Dataset::open(dataset()).unwrap();
    let scene = &opened.scenes[0];
    assert_eq!(scene.views.len(), 5);
    let folder = tempfile::tempdir().unwrap();
    type Format = (&'static str, &'static str, fn(&Path));
    let formats: [Format; 2] =
        [("nerfstudio", "transforms.json", move_in_transforms), ("colmap", "sparse/0", move_in_images)];
    for (format, cameras, move_input) in formats {
        let out = folder.path().join(format);
        let words = ["prep", "export", "--as", format, "--with-ground-truth", "--out"];
        run(mateval().args(words).arg(&out).arg(dataset())).ends_with(0);
        let root = out.join(scene.id.as_str());
        std::fs::copy(opened.folder(&scene.id).instances(), root.join("mesh.glb")).unwrap();
        let deviations = || -> Vec<f64> {
            let read = read_back(&root, cameras, scene);
            assert_eq!(read.len(), scene.views.len());
            let pairs = read.iter().zip(&scene.views);
            pairs
                .map(|(camera, view)| {
                    assert_eq!(camera.lens, Lens::pinhole(&view.camera.intrinsics), "{format}");
                    deviation(camera, view)
                })
                .collect()
        };
        let off = deviations();
        assert!(off.iter().all(|off| *off < SLACK), "{format}: {off:?}");
        // The twin: a moved camera is another one.
        move_input(&root);
        let off = deviations();
        assert!((off[0] / MOVE_M - 1.0).abs() < 1e-3, "{format}: {off:?}");
        assert!(off[1..].iter().all(|off| *off < SLACK), "{format}: {off:?}");
    }
}
