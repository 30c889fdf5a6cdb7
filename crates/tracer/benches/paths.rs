//! Path tracing: CPU seconds per sample on one thread, the speed-up by two threads, and Mitsuba 3 for comparison, in
//! alternating runs. `cargo bench -p mateval-tracer --bench paths [-- ROUNDS [SCENE]]`. SCENE is `bench/room` or
//! `bench/dense` of the shared data, or the number of triangles of a generated room. Without it, all of them run.
//!
//! With `MATEVAL_PEERS_PYTHON` (`target/peers/bin/python`, installed by `tools/test_peers.sh`), Mitsuba's `scalar_rgb`
//! and `llvm_ad_rgb` also render `bench/dense`, on one thread each.
//!
//! 512x512 pixels, 6 bounces (Mitsuba's max_depth 8), no roulette.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]

mod support;

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::time::Instant;

use cpu_time::ProcessTime;
use mateval_dataset::Camera;
use mateval_dataset::reference::ReferenceScene;
use mateval_testkit::bench_scene;
use mateval_tracer::{RenderSettings, World, render};
use rayon::ThreadPool;

use support::{lit, median, room, speedup};

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
        None => Some(lit(room(scene.parse().unwrap()), SIZE)),
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
        1.0 / median(&ours),
        median(&ours) / f64::from(SIZE * SIZE) * 1e6,
        speedup(&walls[0], &walls[1]),
    );
    for ((variant, _), seconds) in VARIANTS.iter().zip(&theirs) {
        println!(
            "  Mitsuba {variant}: {:.3} samples a pixel and CPU second; ours is {:.2} times as fast",
            1.0 / median(seconds),
            speedup(seconds, &ours)
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

/// A Mitsuba 3 process that has loaded a scene and renders on request (`tests/peers/path_speed_mitsuba.py`).
struct Mitsuba {
    process: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Mitsuba {
    /// Loads the folder `scene` for `variant` and renders once, so that everything is compiled.
    fn start(python: &OsStr, variant: &str, scene: &Path, size: u32, max_depth: u32, samples: u32) -> Self {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/peers/path_speed_mitsuba.py");
        let mut process = Command::new(python)
            .args([script.as_os_str(), OsStr::new(variant), scene.as_os_str()])
            .args([size.to_string(), max_depth.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (requests, answers) = (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        let mut mitsuba = Self { process, requests, answers };
        mitsuba.render(samples);
        mitsuba
    }

    /// Renders with `samples` per pixel and returns the CPU seconds it took.
    fn render(&mut self, samples: u32) -> f64 {
        writeln!(self.requests, "{samples}").unwrap();
        let mut answer = String::new();
        self.answers.read_line(&mut answer).unwrap();
        answer.trim().parse().unwrap()
    }
}

impl Drop for Mitsuba {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}
