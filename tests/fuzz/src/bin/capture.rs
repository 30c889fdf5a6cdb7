#![no_main]
//! Reads a captured room: two files of cameras, a mesh and a file of labels or of measured colours. The first bytes of
//! an input select the formats of cameras and mesh; three lengths of four bytes and the files follow.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use mateval_files::source_folder::SourceFolder;
use mateval_sources::capture::{CaptureFiles, measured, read};

/// What a recipe states as cameras, and the two files that it stands for.
const CAMERAS: [(&str, [&str; 2]); 6] = [
    ("transforms.json", ["transforms.json", "unread"]),
    ("colmap", ["colmap/cameras.bin", "colmap/images.bin"]),
    ("colmap", ["colmap/cameras.txt", "colmap/images.txt"]),
    ("cameras.npz", ["cameras.npz", "unread"]),
    ("cam.txt", ["cam.txt", "K_list.txt"]),
    ("lighting", ["lighting/camera_a.txt", "lighting/camera_b.txt"]),
];
const MESHES: [&str; 3] = ["mesh.ply", "mesh.obj", "mesh.glb"];

fuzz_target!(|bytes: &[u8]| {
    let Some((&[cameras, mesh], rest)) = bytes.split_first_chunk() else { return };
    let Some((lengths, rest)) = rest.split_at_checked(12) else { return };
    let length = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|byte| lengths[4 * at + byte])) as usize;
    let (first, rest) = rest.split_at(length(0).min(rest.len()));
    let (second, rest) = rest.split_at(length(1).min(rest.len()));
    let (shape, last) = rest.split_at(length(2).min(rest.len()));
    let (stated, names) = CAMERAS[usize::from(cameras) % CAMERAS.len()];
    let mesh = MESHES[usize::from(mesh) % MESHES.len()];
    mateval_fuzz::with_file(mesh, shape, |path| {
        let root = path.with_file_name("");
        let put = |name: &str, bytes: &[u8]| {
            let place = root.join(name);
            std::fs::create_dir_all(place.parent().unwrap_or(Path::new(""))).expect("the folder is new");
            std::fs::write(place, bytes).expect("there is room for a small file");
        };
        put(names[0], first);
        put(names[1], second);
        for photo in ["a.png", "image_a.png"] {
            put(&format!("photos/{photo}"), b"");
        }
        put("labels.npy", last);
        let labels = (!last.is_empty()).then(|| "labels.npy".to_owned());
        for labels in [labels, None] {
            let files = CaptureFiles {
                root: root.clone(),
                mesh: mesh.to_owned(),
                cameras: stated.to_owned(),
                photos: "photos".to_owned(),
                input: "a".to_owned(),
                novel: Vec::new(),
                labels,
                scale: 1.0,
                up: [0.0, 0.0, 1.0].into(),
                architecture: Vec::new(),
            };
            if let Ok(capture) = read(&files) {
                assert_eq!(capture.read.scene.surfaces.len(), capture.read.origins.len());
                let positions = capture.read.scene.surfaces.iter().flat_map(|surface| &surface.mesh.positions);
                assert!(positions.flat_map(|position| position.to_array()).all(f32::is_finite));
            }
        }
        put("measured.json", last);
        put("maw.txt", last);
        let mut folder = SourceFolder::new(&root, 1 << 20).expect("the folder exists");
        for table in ["measured.json", "maw.txt"] {
            let _ = measured::read(&mut folder, table);
        }
    });
});
