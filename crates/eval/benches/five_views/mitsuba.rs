//! The five views by Mitsuba, in a separate process.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

use mateval_dataset::Camera;
use serde_json::{Value, json};

use crate::stage::Stage;
use crate::{FIT_SIZE, Run, SIZE, ours};

/// Runs `tests/peers/five_views_mitsuba.py` once.
pub fn run(
    python: &OsStr,
    scene: &Path,
    cameras: &[Camera],
    variant: &str,
    round: u64,
    iterations: u32,
    samples: &[u32],
) -> Run {
    let out = tempfile::tempdir().unwrap();
    let target = out.path().join("target.f32");
    let photo = ours::photo(scene);
    let bytes: Vec<u8> = photo.pixels().iter().flat_map(|pixel| pixel.0).flat_map(f32::to_le_bytes).collect();
    std::fs::write(&target, bytes).unwrap();
    let k = cameras[0].intrinsics;
    let fov_x_deg = 2.0 * libm::atan(f64::from(k.width) / 2.0 / k.fx).to_degrees();
    let fit = json!({
        "iterations": iterations, "samples": 16, "size": [FIT_SIZE, FIT_SIZE], "fov_x_deg": fov_x_deg,
        "learning_rate": 0.05, "target": target,
    });
    let matrices: Vec<[[f64; 4]; 4]> = cameras.iter().map(|camera| camera.world_from_camera).collect();
    let job = json!({
        "variant": variant, "scene": scene, "out": out.path(), "max_depth": 8, "seed": round + 1, "samples": samples,
        "size": SIZE, "fov_x_deg": fov_x_deg, "cameras": matrices, "fit": fit,
    });
    let path = out.path().join("job.json");
    std::fs::write(&path, job.to_string()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/peers/five_views_mitsuba.py");
    let status = Command::new(python).arg(&script).arg(&path).status().unwrap();
    assert!(status.success(), "{}: {status}", script.display());
    let result: Value = serde_json::from_slice(&std::fs::read(out.path().join("result.json")).unwrap()).unwrap();
    if let Some(fit) = result.get("fit") {
        let last = fit["losses"].as_array().unwrap().last().unwrap();
        println!(
            "{variant}, fit after {iterations} iterations: median error {:.3}, largest {:.3}, loss {:.5}",
            fit["median_error"].as_f64().unwrap(),
            fit["largest_error"].as_f64().unwrap(),
            last.as_f64().unwrap()
        );
    }
    let picture = |samples: &u32, view: usize| read_floats(&out.path().join(format!("view{view}_{samples}.f32")));
    let all = |samples: &u32| (0..cameras.len()).flat_map(|view| picture(samples, view)).collect();
    Run { stages: stages(&result, iterations), pictures: samples.iter().map(all).collect() }
}

fn stages(result: &Value, iterations: u32) -> Vec<Stage> {
    let stage = |stage: &Value| Stage {
        name: stage["name"].as_str().unwrap().to_owned(),
        samples: stage["samples"].as_u64().unwrap() as u32,
        iterations,
        cpu: stage["cpu"].as_f64().unwrap(),
        wall: stage["wall"].as_f64().unwrap(),
    };
    result["stages"].as_array().unwrap().iter().map(stage).collect()
}

fn read_floats(path: &Path) -> Vec<f32> {
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(bytes.len(), 12 * SIZE[0] * SIZE[1], "{}", path.display());
    bytes.chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect()
}
