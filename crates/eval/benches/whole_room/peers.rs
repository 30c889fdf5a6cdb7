//! Scores the room with other projects' software, in a separate process.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

use mateval_audit::mitsuba_export::export;
use mateval_eval::result::ResultFile;
use mateval_image::{LinearRgb, Picture};
use mateval_metrics::{Lpips, Net};
use mateval_scene::Severity;
use mateval_scene::dataset::View;
use serde_json::{Value, json};

use crate::Run;
use crate::TRACKS;
use crate::peer_scene;
use crate::pictures::{Linear, radiances};
use crate::room::Room;
use crate::stage::Stage;

/// Samples a pixel and iteration of the fit.
const FIT_SAMPLES: u32 = 8;

/// Runs `tests/peers/score_room_mitsuba.py` once, with these numbers of samples a pixel for the tracks; without
/// iterations the fit is left out.
pub fn run(python: &OsStr, room: &Room, scored: &ResultFile, round: u64, iterations: u32, samples: [u32; 2]) -> Run {
    let out = tempfile::tempdir().unwrap();
    let scenes = write_scenes(room, scored, out.path());
    let job = job(room, out.path(), round, iterations, samples, &scenes);
    let path = out.path().join("job.json");
    std::fs::write(&path, job.to_string()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/peers/score_room_mitsuba.py");
    let status = Command::new(python).arg(&script).arg(&path).status().unwrap();
    assert!(status.success(), "{}: {status}", script.display());
    let result: Value = serde_json::from_slice(&std::fs::read(out.path().join("result.json")).unwrap()).unwrap();
    let pictures = TRACKS.map(|track| {
        let view = |k: usize| read_picture(room, &out.path().join(format!("{track}{k}.f32")));
        (0..room.scene.views.len()).map(view).collect::<Vec<_>>()
    });
    if let Some([first, .., last]) = result["losses"].as_array().map(Vec::as_slice) {
        println!("theirs, fit: loss {first} at first, {last} after {iterations} iterations");
    }
    tell_lpips(room, &pictures[0], &result);
    Run { stages: stages(&result, iterations), pictures }
}

/// Both tracks' scenes as Mitsuba's XML; what it cannot represent is printed once.
fn write_scenes(room: &Room, scored: &ResultFile, out: &Path) -> Value {
    let radiances = radiances(room, scored);
    let fitted = match room.stage().as_slice() {
        [] => peer_scene::under_own_lights(room, Some(&radiances)),
        stage => peer_scene::on_stage(room, stage, &radiances),
    };
    let mut paths = serde_json::Map::new();
    for (track, scene) in TRACKS.into_iter().zip([peer_scene::under_own_lights(room, None), fitted]) {
        let folder = out.join(track);
        let settings = room.protocol.light.settings(1);
        for finding in export(&scene, &room.cameras()[0], &settings, &folder).unwrap() {
            if finding.severity != Severity::Note {
                println!("theirs, {track}: {}: {}; {}", finding.place, finding.message, finding.action);
            }
        }
        paths.insert(track.to_owned(), json!(folder.join("scene.xml")));
    }
    Value::Object(paths)
}

fn job(room: &Room, out: &Path, round: u64, iterations: u32, samples: [u32; 2], scenes: &Value) -> Value {
    let k = room.cameras()[0].intrinsics;
    let size = [k.width, k.height];
    let target = out.join("target.f32");
    let photo = room.light[0].shown.pixels().iter().flat_map(|pixel| pixel.0).flat_map(f32::to_le_bytes);
    std::fs::write(&target, photo.collect::<Vec<u8>>()).unwrap();
    let fov_x_deg = 2.0 * libm::atan(f64::from(k.width) / 2.0 / k.fx).to_degrees();
    // Mitsuba also counts the camera's ray and the last segment of direct light.
    let max_depth = room.protocol.light.max_bounces + 2;
    let matrices: Vec<[[f64; 4]; 4]> = room.cameras().iter().map(|camera| camera.world_from_camera).collect();
    let [own, fitted] = samples;
    json!({
        "variant": "llvm_ad_rgb", "scenes": scenes, "out": out, "seed": round + 1, "max_depth": max_depth,
        "samples": {"true": own, "fitted": fitted},
        "size": size, "fov_x_deg": fov_x_deg, "cameras": matrices, "exposure": room.scene.exposure,
        "fit": {
            "iterations": iterations, "samples": FIT_SAMPLES, "size": size, "fov_x_deg": fov_x_deg,
            "learning_rate": 0.05, "target": target,
        },
        "views": room.scene.views.iter().map(|view| view_files(room, view)).collect::<Vec<_>>(),
        "lpips_weights": room.weights,
    })
}

fn view_files(room: &Room, view: &View) -> Value {
    let folder = room.folder.view(&view.id);
    let unobserved = folder.join("unobserved.png");
    let mut masks = json!({"valid": folder.join("valid.png")});
    if unobserved.is_file() {
        masks["unobserved"] = json!(unobserved);
    }
    json!({
        "rgb": room.folder.render(&room.renderer, &view.id).join("rgb.exr"),
        "albedo": room.folder.truth_view(&view.id).join("albedo.exr"),
        "masks": masks,
        "size": [view.camera.intrinsics.width, view.camera.intrinsics.height],
    })
}

/// Asserts that both packages compute the same LPIPS for the same whole pictures.
fn tell_lpips(room: &Room, pictures: &[Linear], result: &Value) {
    let Some(weights) = &room.weights else { return };
    let lpips = Lpips::load(Net::Alex, weights).unwrap();
    let theirs = result["whole_lpips"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap());
    let pairs = pictures.iter().zip(&room.light).zip(theirs);
    let differences = pairs.map(|((picture, truth), theirs)| {
        let ours = lpips.whole(&picture.to_srgb(), &truth.shown.to_srgb()).unwrap();
        (ours - theirs).abs()
    });
    let largest = differences.fold(0.0, f64::max);
    println!("LPIPS of the same pictures: ours and theirs differ by at most {largest:.1e}");
    assert!(largest < 1e-4, "LPIPS differs by {largest}");
}

/// Merges stages with the same name.
fn stages(result: &Value, iterations: u32) -> Vec<Stage> {
    let mut stages: Vec<Stage> = Vec::new();
    for stage in result["stages"].as_array().unwrap() {
        let stage = Stage {
            name: stage["name"].as_str().unwrap().to_owned(),
            samples: stage["samples"].as_u64().unwrap() as u32,
            iterations,
            cpu: stage["cpu"].as_f64().unwrap(),
            wall: stage["wall"].as_f64().unwrap(),
        };
        match stages.iter_mut().find(|known| known.name == stage.name) {
            Some(known) => *known = known.plus(&stage),
            None => stages.push(stage),
        }
    }
    stages
}

fn read_picture(room: &Room, path: &Path) -> Linear {
    let k = room.cameras()[0].intrinsics;
    let bytes = std::fs::read(path).unwrap();
    let floats: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    let pixels = floats.as_chunks::<3>().0.iter().map(|rgb| LinearRgb(*rgb)).collect();
    Picture::new(k.width as usize, k.height as usize, pixels).unwrap()
}
