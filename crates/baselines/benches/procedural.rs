//! Time and memory of the procedural baseline, part by part of the work.
//!
//! `cargo bench -p mateval-baselines --bench procedural -- DATASET [SCENE...]` prints for each rendered scene the CPU
//! seconds (of all threads) of the de-lit photo and of fitting and baking, the numbers of parts and atlases,
//! and the process's peak memory so far.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]

use std::path::PathBuf;

use mateval_baselines::delight::CandidateLights;
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::geometry::SceneGeometry;
use mateval_baselines::procedural::{ProceduralOptions, scene_maps};
use mateval_dataset::open::Dataset;
use mateval_dataset::scene_cost::processor_time;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let Some(dataset) = words.first() else {
        println!("usage: cargo bench -p mateval-baselines --bench procedural -- DATASET [SCENE...]");
        return;
    };
    let dataset = Dataset::open(&PathBuf::from(dataset)).unwrap();
    for scene in dataset.scenes.iter().filter(|scene| words.len() == 1 || words[1..].contains(&scene.id.to_string())) {
        let start = seconds();
        let estimate = EstimateSource::Delight(CandidateLights::Room).read(&dataset, scene, &|_| ()).unwrap();
        let delit = seconds();
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene).unwrap();
        let baked = scene_maps(&geometry, &estimate, &ProceduralOptions::default(), &|_| ()).unwrap();
        let made = seconds();
        println!(
            "{}: {} parts, {} atlases; de-lit in {:.1} s, fitted and baked in {:.1} s; peak {} MiB",
            scene.id,
            scene.parts.len(),
            baked.len(),
            delit - start,
            made - delit,
            peak_mib()
        );
    }
}

fn seconds() -> f64 {
    processor_time().unwrap_or_default().as_secs_f64()
}

/// Peak resident memory; 0 where the system does not state it.
fn peak_mib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().split(' ').next()?.parse::<u64>().ok()).unwrap_or(0) / 1024
}
