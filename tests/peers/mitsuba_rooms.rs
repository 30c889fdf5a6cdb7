//! Rooms: the built-in sample, the shared bench scenes and two of Bitterli's.

use std::path::Path;

use mateval_dataset::Camera;
use mateval_dataset::reference::ReferenceScene;
use mateval_sources::bitterli::{self, Limits};
use mateval_testkit::shared_data;

use super::mitsuba::{Case, all_agree};
use mateval_testkit::bench_scene;

fn case(name: &str, scene: ReferenceScene, camera: Camera, samples: u32) -> Case {
    Case { name: name.to_owned(), scene, camera, samples }
}

/// A Mitsuba scene, read by our reader, with a picture `width` pixels wide.
fn source(name: &str, xml: &Path, width: u32, samples: u32) -> Case {
    let read = bitterli::read(xml, None, &Limits::default()).unwrap();
    let mut camera = read.camera.unwrap();
    let scale = f64::from(width) / f64::from(camera.intrinsics.width);
    let k = &mut camera.intrinsics;
    // Whole pixels and equal focal lengths along both axes; the picture may lose part of a row.
    (k.width, k.height) = (width, (f64::from(k.height) * scale) as u32);
    (k.fx, k.fy, k.cx, k.cy) = (k.fx * scale, k.fy * scale, k.cx * scale, k.cy * scale);
    case(name, read.scene, camera, samples)
}

#[test]
fn sample_room() {
    let folder = tempfile::tempdir().unwrap();
    mateval_sample::write(folder.path()).unwrap();
    all_agree(vec![source("sample room", &folder.path().join("room/scene.xml"), 80, 32)]);
}

#[test]
fn bench_rooms() {
    for (name, samples) in [("room", 32), ("dense", 16)] {
        let Some(folder) = bench_scene::folder(name) else { continue };
        let (scene, camera) = bench_scene::read(&folder, 64);
        all_agree(vec![case(&format!("bench/{name}"), scene, camera, samples)]);
    }
}

#[test]
fn bitterli_rooms() {
    for (name, samples) in [("staircase2", 32), ("living-room", 32)] {
        if let Some(xml) = shared_data(&format!("bitterli/{name}/scene.xml")) {
            all_agree(vec![source(name, &xml, 80, samples)]);
        }
    }
}
