//! Path tracing: CPU seconds per sample on one thread, the speed-up by two threads, and Mitsuba 3 for comparison, in
//! alternating runs. `cargo bench -p mateval-tracer --bench paths [-- ROUNDS [SCENE]]`. SCENE is `bench/room` or
//! `bench/dense` of the shared data, or the number of triangles of a generated room. Without it, all of them run.
//!
//! With `MATEVAL_PEERS_PYTHON` (`target/peers/bin/python`, installed by `tools/test_peers.sh`), Mitsuba's `scalar_rgb`
//! and `llvm_ad_rgb` also render `bench/dense`, on one thread each.
//!
//! 512x512 pixels, 6 bounces (Mitsuba's max_depth 8), no roulette.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]

#[path = "support/mitsuba.rs"]
mod mitsuba;
#[path = "support/room.rs"]
mod room;
#[path = "support/timing.rs"]
mod timing;

use std::sync::Arc;
use std::time::Instant;

use cpu_time::ProcessTime;
use mateval_scene::Camera;
use mateval_scene::reference::ReferenceScene;
use mateval_testkit::bench_scene;
use mateval_tracer::{RenderSettings, World, render};
use mitsuba::Mitsuba;
use rayon::ThreadPool;

const SIZE: u32 = 512;
const MAX_BOUNCES: u32 = 6;
/// Samples per pixel and measurement, for us and for Mitsuba's variants. The LLVM variant needs many samples for its
/// best speed; the scalar one has the same speed for any number.
const SAMPLES: u32 = 4;
const VARIANTS: [(&str, u32); 2] = [("scalar_rgb", 1), ("llvm_ad_rgb", 16)];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let rounds: usize = words.first().map_or(5, |word| word.parse().unwrap());
    let scenes = ["bench/room", "bench/dense", "20000", "1000000", "3000000"];
    for scene in words.get(1).map_or(scenes.to_vec(), |scene| vec![scene.as_str()]) {
        let Some((reference, camera)) = load(scene) else { continue };
        measure(scene, reference, &camera, rounds);
    }
}

fn load(scene: &str) -> Option<(ReferenceScene, Camera)> {
    match scene.strip_prefix("bench/") {
        Some(name) => Some(bench_scene::read(&bench_scene::folder(name)?, SIZE)),
        None => Some(room::lit(room::room(scene.parse().unwrap()), SIZE)),
    }
}

fn measure(name: &str, scene: ReferenceScene, camera: &Camera, rounds: usize) {
    let triangles: usize = scene.surfaces.iter().map(|surface| surface.mesh.triangles.len()).sum();
    let world = World::new(Arc::new(scene)).unwrap();
    let mut peers = peers(name);
    let pools = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap());
    let (mut ours, mut walls, mut rays) = (Vec::new(), [Vec::new(), Vec::new()], 0.0);
    let mut theirs = vec![Vec::new(); peers.len()];
    // Run all contestants once per round.
    for round in 0..rounds {
        for (pool, walls) in pools.iter().zip(&mut walls) {
            let run = run(&world, camera, pool, round as u64);
            walls.push(run.wall);
            rays = run.rays;
            if pool.current_num_threads() == 1 {
                ours.push(run.cpu);
            }
        }
        for ((mitsuba, (_, samples)), seconds) in peers.iter_mut().zip(VARIANTS).zip(&mut theirs) {
            seconds.push(mitsuba.render(samples) / f64::from(samples));
        }
    }
    // Report medians.
    println!(
        "{name}, {triangles} triangles: {:.3} samples a pixel and CPU second, {:.2} us a sample, {rays:.1} rays a sample; \
         2 threads {:.2} times 1",
        1.0 / timing::median(&ours),
        timing::median(&ours) / f64::from(SIZE * SIZE) * 1e6,
        timing::speedup(&walls[0], &walls[1]),
    );
    for ((variant, _), seconds) in VARIANTS.iter().zip(&theirs) {
        println!(
            "  Mitsuba {variant}: {:.3} samples a pixel and CPU second; ours is {:.2} times as fast",
            1.0 / timing::median(seconds),
            timing::speedup(seconds, &ours)
        );
    }
}

fn peers(scene: &str) -> Vec<Mitsuba> {
    if scene != "bench/dense" {
        return Vec::new();
    }
    let Some(python) = std::env::var_os("MATEVAL_PEERS_PYTHON") else {
        println!("SKIPPED: Mitsuba, MATEVAL_PEERS_PYTHON is not set");
        return Vec::new();
    };
    let folder = bench_scene::folder("dense").unwrap();
    let start = |(variant, samples)| Mitsuba::start(&python, variant, &folder, SIZE, MAX_BOUNCES + 2, samples);
    VARIANTS.map(start).into()
}

/// The time that one picture took, per sample.
struct Run {
    cpu: f64,
    wall: f64,
    rays: f64,
}

fn run(world: &World, camera: &Camera, pool: &ThreadPool, seed: u64) -> Run {
    let settings = RenderSettings {
        samples: SAMPLES,
        seed,
        max_bounces: MAX_BOUNCES,
        roulette_start: u32::MAX,
        ..RenderSettings::default()
    };
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let stats = pool.install(|| render(world, camera, &settings, &|_, _| ())).unwrap().stats;
    let a_sample = |seconds: f64| seconds / f64::from(SAMPLES);
    Run {
        cpu: a_sample(cpu.elapsed().as_secs_f64()),
        wall: a_sample(wall.elapsed().as_secs_f64()),
        rays: (stats.rays + stats.shadow_rays) as f64 / stats.paths as f64,
    }
}
