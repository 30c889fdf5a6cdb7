//! Ray queries compared with Debian's Embree 3.13 (`apt-get install libembree-dev`): the same rays in the same process,
//! in alternating runs. `cargo bench -p mateval-tracer --features bench-embree --bench against_embree [-- ROUNDS]`.
//!
//! Scenes: `bench/dense` if the shared data is available, and the built-in room with 20 thousand, 1 million and 3
//! million triangles. CPU time of one thread. Each number is our rays per second over those of Embree's medium mode. A
//! star marks `closest_many` and `occluded_many`, as the path tracer uses them; the other numbers are for one ray at a
//! time.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]

#[path = "support/embree.rs"]
mod embree;
#[path = "support/rays.rs"]
mod rays;
#[path = "support/room.rs"]
mod room;
#[path = "support/timing.rs"]
mod timing;

use glam::Vec3;
use mateval_scene::{Camera, TriangleMesh};
use mateval_testkit::bench_scene;
use mateval_tracer::{Accel, Ray, TriangleTest};

use embree::{Embree, Mode};

const SIDE: u32 = 724;

fn main() {
    let rounds = std::env::args().skip(1).find_map(|word| word.parse().ok()).unwrap_or(9);
    // A single thread measures the cost of a ray, not how well threads share the machine.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap();
    if let Some(folder) = bench_scene::folder("dense") {
        let (scene, camera) = bench_scene::read(&folder, SIDE);
        compare("bench/dense", scene.surfaces.into_iter().map(|s| s.mesh).collect(), &camera, rounds);
    }
    for triangles in [20_000, 1_000_000, 3_000_000] {
        compare("room", room::room(triangles), &room::camera(SIDE), rounds);
    }
}

fn compare(name: &str, meshes: Vec<TriangleMesh>, camera: &Camera, rounds: usize) {
    let meshes: Vec<&TriangleMesh> = meshes.iter().collect();
    let triangles: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    println!("\n{name}, {triangles} triangles");
    builds(&meshes);
    // Build both hierarchies in both modes.
    let robust = Accel::build(&meshes).unwrap();
    let fast = Accel::build(&meshes).unwrap().with_test(TriangleTest::Fast);
    let embree = Embree::new(&meshes, Mode::Medium, 1, &mut |build| build());
    let embree_robust = Embree::new(&meshes, Mode::Robust, 1, &mut |build| build());
    println!("{:.1} bytes a triangle", robust.memory_bytes() as f64 / triangles as f64);

    // Make the sets of rays.
    let coherent = rays::coherent(camera);
    let bounce = rays::bounced(&robust, &coherent);
    let second = rays::bounced(&robust, &bounce);
    let random = rays::uniform(&robust, SIDE * SIDE);
    let shadow = rays::towards_ceiling(&robust, &coherent, Vec3::Z);
    let shadow_2 = rays::towards_ceiling(&robust, &bounce, Vec3::Z);
    let short = rays::shortened(&random, 1.5);
    println!(
        "{:22} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "times Embree's medium", "Embree's", "its robust", "fast", "watertight", "fast*", "watert.*", "differ"
    );
    // Compare nearest hits.
    for (kind, set) in [("coherent", &coherent), ("bounce 1", &bounce), ("bounce 2", &second), ("random", &random)] {
        let differing =
            set.iter().filter(|ray| differs(robust.closest(ray).map(|h| h.distance), embree.closest(ray))).count();
        row(
            kind,
            set.len(),
            differing,
            rounds,
            [
                Box::new(|| sum(set, |ray| embree.closest(ray).map(|hit| hit.2))),
                Box::new(|| sum(set, |ray| embree_robust.closest(ray).map(|hit| hit.2))),
                Box::new(|| sum(set, |ray| fast.closest(ray).map(|hit| hit.distance))),
                Box::new(|| sum(set, |ray| robust.closest(ray).map(|hit| hit.distance))),
                Box::new(|| {
                    sum_many(set, |rays, values| fast.closest_many(rays, values), |hit| hit.map(|h| h.distance))
                }),
                Box::new(|| {
                    sum_many(set, |rays, values| robust.closest_many(rays, values), |hit| hit.map(|h| h.distance))
                }),
            ],
        );
    }
    // Compare occlusion.
    for (kind, set) in [("shadow 1", &shadow), ("shadow 2", &shadow_2), ("occlusion to 1.5 m", &short)] {
        let differing = set.iter().filter(|ray| robust.occluded(ray) != embree.occluded(ray)).count();
        row(
            kind,
            set.len(),
            differing,
            rounds,
            [
                Box::new(|| sum(set, |ray| embree.occluded(ray).then_some(1.0))),
                Box::new(|| sum(set, |ray| embree_robust.occluded(ray).then_some(1.0))),
                Box::new(|| sum(set, |ray| fast.occluded(ray).then_some(1.0))),
                Box::new(|| sum(set, |ray| robust.occluded(ray).then_some(1.0))),
                Box::new(|| sum_many(set, |rays, values| fast.occluded_many(rays, values), |hit| hit.then_some(1.0))),
                Box::new(|| sum_many(set, |rays, values| robust.occluded_many(rays, values), |hit| hit.then_some(1.0))),
            ],
        );
    }
}

/// Distances that differ by more than rounding.
fn differs(ours: Option<f32>, theirs: Option<(usize, usize, f32)>) -> bool {
    match (ours, theirs) {
        (Some(ours), Some((_, _, theirs))) => (ours - theirs).abs() > 1e-4 * theirs.max(1.0),
        (None, None) => false,
        _ => true,
    }
}

fn builds(meshes: &[&TriangleMesh]) {
    let mut embree_seconds = Vec::new();
    let mut seconds = Vec::new();
    for _ in 0..5 {
        let mut timed = |build: &mut dyn FnMut()| {
            let start = cpu_time::ProcessTime::now();
            build();
            embree_seconds.push(start.elapsed().as_secs_f64());
        };
        Embree::new(meshes, Mode::Medium, 1, &mut timed);
        let start = cpu_time::ProcessTime::now();
        Accel::build(meshes).unwrap();
        seconds.push(start.elapsed().as_secs_f64());
    }
    let (theirs, ours) = (timing::median(&embree_seconds), timing::median(&seconds));
    println!(
        "build: Embree {theirs:.3} s, ours {ours:.3} s: {:.2} times as long",
        1.0 / timing::speedup(&embree_seconds, &seconds)
    );
}

fn sum(rays: &[Ray], value: impl Fn(&Ray) -> Option<f32>) {
    std::hint::black_box(rays.iter().filter_map(value).map(f64::from).sum::<f64>());
}

/// The same for batches of the size that the path tracer uses.
fn sum_many<V: Copy>(rays: &[Ray], trace: impl Fn(&[Ray], &mut Vec<V>), value: impl Fn(V) -> Option<f32>) {
    let mut values = Vec::new();
    let mut sum = 0.0;
    for batch in rays.chunks(256) {
        trace(batch, &mut values);
        sum += values.iter().filter_map(|v| value(*v)).map(f64::from).sum::<f64>();
    }
    std::hint::black_box(sum);
}

fn row<'a>(kind: &str, count: usize, differing: usize, rounds: usize, runs: [Box<dyn FnMut() + 'a>; 6]) {
    let names = ["medium", "robust", "fast", "watertight", "fast, many", "watertight, many"];
    let mut contestants: Vec<timing::Contestant> = names.into_iter().zip(runs).collect();
    let seconds = timing::interleaved(rounds, &mut contestants);
    let rate = |seconds: &[f64]| count as f64 / timing::median(seconds) / 1e6;
    let ratio = |which: usize| timing::speedup(&seconds[0], &seconds[which]);
    println!(
        "{kind:22} {:6.2} M/s {:9.2} {:9.2} {:9.2} {:9.2} {:9.2} {differing:9}",
        rate(&seconds[0]),
        ratio(1),
        ratio(2),
        ratio(3),
        ratio(4),
        ratio(5)
    );
}
