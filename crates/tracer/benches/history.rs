//! The price of derivatives: CPU seconds of a render that keeps the history of its paths over those of a plain render,
//! in alternating runs on one thread. `cargo bench -p mateval-tracer --bench history [-- ROUNDS [SCENE]]`. SCENE is
//! `bench/room` of the shared data, or the number of triangles of a generated room.
//!
//! 256x256 pixels, 4 samples, default settings, blocks of 8x8 pixels, and one grid of 512x512 texels for the largest
//! surface with uv. The design allows a factor of 1.2.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]

#[path = "support/room.rs"]
mod room;
#[path = "support/timing.rs"]
mod timing;

use std::sync::Arc;

use mateval_image::{LinearRgb, Picture, TexelGrid, Wrap};
use mateval_scene::Camera;
use mateval_scene::reference::ReferenceScene;
use mateval_testkit::bench_scene;
use mateval_tracer::{RenderSettings, World, gradient, part_jacobian, render};

const SIZE: u32 = 256;
const BLOCK: usize = 8;
const GRID: TexelGrid = TexelGrid { width: 512, height: 512, wrap: Wrap::Clamp };

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let rounds: usize = words.first().map_or(5, |word| word.parse().unwrap());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for scene in words.get(1).map_or(vec!["bench/room", "20000"], |scene| vec![scene.as_str()]) {
        let Some((reference, camera)) = load(scene) else { continue };
        pool.install(|| measure(scene, reference, &camera, rounds));
    }
}

fn load(scene: &str) -> Option<(ReferenceScene, Camera)> {
    match scene.strip_prefix("bench/") {
        Some(name) => Some(bench_scene::read(&bench_scene::folder(name)?, SIZE)),
        None => Some(room::lit(room::room(scene.parse().unwrap()), SIZE)),
    }
}

fn measure(name: &str, scene: ReferenceScene, camera: &Camera, rounds: usize) {
    let world = World::new(Arc::new(scene)).unwrap();
    let settings = RenderSettings { samples: 4, ..RenderSettings::default() };
    let residual = Picture::filled(SIZE as usize, SIZE as usize, LinearRgb([1.0; 3]));
    let surfaces = &world.scene().surfaces;
    let with_uv = (0..surfaces.len()).filter(|&index| surfaces[index].mesh.uvs.is_some());
    let chosen = with_uv.max_by_key(|&index| surfaces[index].mesh.triangles.len());
    let grids: Vec<_> = (0..surfaces.len()).map(|index| (Some(index) == chosen).then_some(GRID)).collect();
    let quiet = |_: usize, _: usize| ();
    let seconds = timing::interleaved(
        rounds,
        &mut [
            ("plain", Box::new(|| drop(render(&world, camera, &settings, &quiet).unwrap()))),
            ("parts", Box::new(|| drop(part_jacobian(&world, camera, BLOCK, &settings, &quiet).unwrap()))),
            ("texels", Box::new(|| drop(gradient(&world, camera, &residual, &grids, &settings, &quiet).unwrap()))),
        ],
    );
    println!(
        "{name}, {} surfaces: plain {:.3} s, derivatives by parts {:.3} times that, by texels {:.3} times",
        surfaces.len(),
        timing::median(&seconds[0]),
        timing::speedup(&seconds[1], &seconds[0]),
        timing::speedup(&seconds[2], &seconds[0]),
    );
}
