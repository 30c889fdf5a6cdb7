//! Path tracing: samples a pixel and CPU second, of one thread, and what two threads gain.
//! `cargo bench -p mateval-tracer --bench paths [-- SCENE [ROUNDS]]`, SCENE `room` or `dense` of the shared data.
//!
//! 512x512 pixels, 6 bounces (Mitsuba's max_depth 8), no roulette, as `tests/peers/path_speed_mitsuba.py`.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]

#[path = "../tests/suite/bench_scene.rs"]
mod bench_scene;
#[path = "support/timing.rs"]
mod timing;

use std::sync::Arc;
use std::time::Instant;

use cpu_time::ProcessTime;
use mateval_tracer::{RenderSettings, World, render};

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let scenes = words.first().map_or(vec!["room", "dense"], |scene| vec![scene.as_str()]);
    let rounds: usize = words.get(1).map_or(5, |word| word.parse().unwrap());
    for scene in scenes {
        let Some(folder) = bench_scene::folder(scene) else {
            println!("SKIPPED: bench/{scene} is not here; set MATEVAL_DATA");
            continue;
        };
        let (reference, camera) = bench_scene::read(&folder, 512);
        let world = World::new(Arc::new(reference)).unwrap();
        let settings =
            RenderSettings { samples: 1, max_bounces: 6, roulette_start: u32::MAX, ..RenderSettings::default() };
        let (mut alone, mut walls) = (Vec::new(), [Vec::new(), Vec::new()]);
        let pools = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap());
        let mut rays = 0.0;
        for round in 0..rounds {
            for (pool, walls) in pools.iter().zip(&mut walls) {
                let settings = RenderSettings { seed: round as u64, ..settings };
                let (wall, cpu) = (Instant::now(), ProcessTime::now());
                let stats = pool.install(|| render(&world, &camera, &settings, &|_, _| ())).unwrap().stats;
                walls.push(wall.elapsed().as_secs_f64());
                if pool.current_num_threads() == 1 {
                    alone.push(cpu.elapsed().as_secs_f64());
                }
                rays = (stats.rays + stats.shadow_rays) as f64 / stats.paths as f64;
            }
        }
        println!(
            "bench/{scene}: {:.3} samples a pixel and CPU second, {:.2} us a sample, {rays:.1} rays a sample; 2 threads {:.2} times 1",
            1.0 / timing::median(&alone),
            timing::median(&alone) / (512.0 * 512.0) * 1e6,
            timing::speedup(&walls[0], &walls[1]),
        );
    }
}
