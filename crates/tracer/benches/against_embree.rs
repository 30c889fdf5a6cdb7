//! Ray queries compared with Debian's Embree 3.13 (`apt-get install libembree-dev`): the same rays in the same process,
//! in alternating runs. `cargo bench -p mateval-tracer --features bench-embree --bench against_embree [-- ROUNDS]`.
//!
//! Scenes: `bench/dense` if the shared data is available, and the built-in room with 20 thousand, 1 million and 3
//! million triangles. CPU time of one thread. Each number is our rays per second over those of Embree's medium mode. A
//! star marks `closest_many` and `occluded_many`, as the path tracer uses them; the other numbers are for one ray at a
//! time.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]
#![allow(unsafe_code, reason = "Embree is a C library")]

mod support;

use std::ffi::{CString, c_char, c_int, c_uint, c_void};

use glam::{DVec2, Vec3};
use mateval_dataset::{Camera, TriangleMesh};
use mateval_testkit::bench_scene;
use mateval_tracer::{Accel, Ray};

use support::{Contestant, camera, interleaved, median, room, speedup};

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
        compare("room", room(triangles), &camera(SIDE), rounds);
    }
}

fn compare(name: &str, meshes: Vec<TriangleMesh>, camera: &Camera, rounds: usize) {
    let meshes: Vec<&TriangleMesh> = meshes.iter().collect();
    let triangles: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    println!("\n{name}, {triangles} triangles");
    builds(&meshes);
    // Build both hierarchies, theirs in both modes.
    let ours = Accel::build(&meshes).unwrap();
    let embree = Embree::new(&meshes, Mode::Medium, 1, &mut |build| build());
    let embree_robust = Embree::new(&meshes, Mode::Robust, 1, &mut |build| build());
    println!("{:.1} bytes a triangle", ours.memory_bytes() as f64 / triangles as f64);

    // Make the sets of rays.
    let coherent = coherent(camera);
    let bounce = bounced(&ours, &coherent);
    let second = bounced(&ours, &bounce);
    let random = uniform(&ours, SIDE * SIDE);
    let shadow = towards_ceiling(&ours, &coherent, Vec3::Z);
    let shadow_2 = towards_ceiling(&ours, &bounce, Vec3::Z);
    let short = shortened(&random, 1.5);
    println!(
        "{:22} {:>10} {:>9} {:>9} {:>9} {:>9}",
        "times Embree's medium", "Embree's", "its robust", "ours", "ours*", "differ"
    );
    // Compare nearest hits.
    for (kind, set) in [("coherent", &coherent), ("bounce 1", &bounce), ("bounce 2", &second), ("random", &random)] {
        let differing =
            set.iter().filter(|ray| differs(ours.closest(ray).map(|h| h.distance), embree.closest(ray))).count();
        row(
            kind,
            set.len(),
            differing,
            rounds,
            [
                Box::new(|| sum(set, |ray| embree.closest(ray).map(|hit| hit.2))),
                Box::new(|| sum(set, |ray| embree_robust.closest(ray).map(|hit| hit.2))),
                Box::new(|| sum(set, |ray| ours.closest(ray).map(|hit| hit.distance))),
                Box::new(|| {
                    sum_many(set, |rays, values| ours.closest_many(rays, values), |hit| hit.map(|h| h.distance))
                }),
            ],
        );
    }
    // Compare occlusion.
    for (kind, set) in [("shadow 1", &shadow), ("shadow 2", &shadow_2), ("occlusion to 1.5 m", &short)] {
        let differing = set.iter().filter(|ray| ours.occluded(ray) != embree.occluded(ray)).count();
        row(
            kind,
            set.len(),
            differing,
            rounds,
            [
                Box::new(|| sum(set, |ray| embree.occluded(ray).then_some(1.0))),
                Box::new(|| sum(set, |ray| embree_robust.occluded(ray).then_some(1.0))),
                Box::new(|| sum(set, |ray| ours.occluded(ray).then_some(1.0))),
                Box::new(|| sum_many(set, |rays, values| ours.occluded_many(rays, values), |hit| hit.then_some(1.0))),
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
    let (theirs, ours) = (median(&embree_seconds), median(&seconds));
    println!(
        "build: Embree {theirs:.3} s, ours {ours:.3} s: {:.2} times as long",
        1.0 / speedup(&embree_seconds, &seconds)
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

fn row<'a>(kind: &str, count: usize, differing: usize, rounds: usize, runs: [Box<dyn FnMut() + 'a>; 4]) {
    let names = ["medium", "robust", "ours", "ours, many"];
    let mut contestants: Vec<Contestant> = names.into_iter().zip(runs).collect();
    let seconds = interleaved(rounds, &mut contestants);
    let rate = |seconds: &[f64]| count as f64 / median(seconds) / 1e6;
    let ratio = |which: usize| speedup(&seconds[0], &seconds[which]);
    println!(
        "{kind:22} {:6.2} M/s {:9.2} {:9.2} {:9.2} {differing:9}",
        rate(&seconds[0]),
        ratio(1),
        ratio(2),
        ratio(3)
    );
}

/// Embree's build and traversal mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// RTC_BUILD_QUALITY_MEDIUM, the default.
    Medium,
    /// The same with RTC_SCENE_FLAG_ROBUST.
    Robust,
}

/// A committed scene of Debian's Embree 3.13 (libembree-dev; header rtcore.h): bindings to the part that is used here.
struct Embree {
    device: *mut c_void,
    scene: *mut c_void,
}

#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct RtcRay {
    origin: [f32; 3],
    tnear: f32,
    direction: [f32; 3],
    time: f32,
    tfar: f32,
    mask: c_uint,
    id: c_uint,
    flags: c_uint,
}

#[repr(C, align(16))]
struct RtcRayHit {
    ray: RtcRay,
    normal: [f32; 3],
    u: f32,
    v: f32,
    triangle: c_uint,
    geometry: c_uint,
    instance: c_uint,
}

#[repr(C)]
struct RtcIntersectContext {
    flags: c_uint,
    filter: *const c_void,
    instance: c_uint,
}

const INVALID: c_uint = c_uint::MAX;
const TRIANGLES: c_int = 0;
const INDEX_BUFFER: c_int = 0;
const VERTEX_BUFFER: c_int = 1;
const FORMAT_UINT3: c_int = 0x5003;
const FORMAT_FLOAT3: c_int = 0x9003;
const QUALITY_MEDIUM: c_int = 1;
const FLAG_ROBUST: c_int = 1 << 2;

#[link(name = "embree3")]
unsafe extern "C" {
    fn rtcNewDevice(config: *const c_char) -> *mut c_void;
    fn rtcReleaseDevice(device: *mut c_void);
    fn rtcNewScene(device: *mut c_void) -> *mut c_void;
    fn rtcReleaseScene(scene: *mut c_void);
    fn rtcSetSceneBuildQuality(scene: *mut c_void, quality: c_int);
    fn rtcSetSceneFlags(scene: *mut c_void, flags: c_int);
    fn rtcNewGeometry(device: *mut c_void, kind: c_int) -> *mut c_void;
    fn rtcReleaseGeometry(geometry: *mut c_void);
    fn rtcSetNewGeometryBuffer(
        geometry: *mut c_void,
        kind: c_int,
        slot: c_uint,
        format: c_int,
        stride: usize,
        count: usize,
    ) -> *mut c_void;
    fn rtcCommitGeometry(geometry: *mut c_void);
    fn rtcAttachGeometryByID(scene: *mut c_void, geometry: *mut c_void, id: c_uint);
    fn rtcCommitScene(scene: *mut c_void);
    fn rtcIntersect1(scene: *mut c_void, context: *mut RtcIntersectContext, hit: *mut RtcRayHit);
    fn rtcOccluded1(scene: *mut c_void, context: *mut RtcIntersectContext, ray: *mut RtcRay);
}

impl Embree {
    /// Copies the meshes and builds the scene with `threads` threads. `built` is called around the build alone.
    fn new(meshes: &[&TriangleMesh], mode: Mode, threads: usize, built: &mut dyn FnMut(&mut dyn FnMut())) -> Self {
        let config = CString::new(format!("threads={threads},start_threads=1")).unwrap();
        // SAFETY: the calls follow the order in Embree's manual, and buffers have the lengths requested.
        unsafe {
            let device = rtcNewDevice(config.as_ptr());
            assert!(!device.is_null());
            let scene = rtcNewScene(device);
            rtcSetSceneBuildQuality(scene, QUALITY_MEDIUM);
            rtcSetSceneFlags(scene, if mode == Mode::Robust { FLAG_ROBUST } else { 0 });
            for (id, mesh) in meshes.iter().enumerate() {
                let geometry = rtcNewGeometry(device, TRIANGLES);
                let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
                let to = rtcSetNewGeometryBuffer(geometry, VERTEX_BUFFER, 0, FORMAT_FLOAT3, 12, vertices);
                std::ptr::copy_nonoverlapping(mesh.positions.as_ptr().cast::<f32>(), to.cast(), 3 * vertices);
                let to = rtcSetNewGeometryBuffer(geometry, INDEX_BUFFER, 0, FORMAT_UINT3, 12, triangles);
                std::ptr::copy_nonoverlapping(mesh.triangles.as_ptr().cast::<u32>(), to.cast(), 3 * triangles);
                rtcCommitGeometry(geometry);
                rtcAttachGeometryByID(scene, geometry, id as c_uint);
                rtcReleaseGeometry(geometry);
            }
            built(&mut || rtcCommitScene(scene));
            Self { device, scene }
        }
    }

    /// Surface, triangle and distance of the nearest hit.
    #[inline]
    fn closest(&self, ray: &Ray) -> Option<(usize, usize, f32)> {
        let mut hit = RtcRayHit {
            ray: rtc_ray(ray),
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            triangle: INVALID,
            geometry: INVALID,
            instance: INVALID,
        };
        // SAFETY: the scene is committed; both structures are laid out as in the header.
        unsafe { rtcIntersect1(self.scene, &mut context(), &mut hit) };
        (hit.geometry != INVALID).then_some((hit.geometry as usize, hit.triangle as usize, hit.ray.tfar))
    }

    /// Whether the ray hits anything.
    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        let mut ray = rtc_ray(ray);
        // SAFETY: as in `closest`.
        unsafe { rtcOccluded1(self.scene, &mut context(), &mut ray) };
        ray.tfar < 0.0
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: `new` created both, and they are not used again.
        unsafe {
            rtcReleaseScene(self.scene);
            rtcReleaseDevice(self.device);
        }
    }
}

#[inline]
fn context() -> RtcIntersectContext {
    RtcIntersectContext { flags: 0, filter: std::ptr::null(), instance: INVALID }
}

#[inline]
fn rtc_ray(ray: &Ray) -> RtcRay {
    RtcRay {
        origin: ray.origin().to_array(),
        tnear: 0.0,
        direction: ray.direction().to_array(),
        time: 0.0,
        tfar: ray.max_distance(),
        mask: INVALID,
        id: 0,
        flags: 0,
    }
}

/// Unstratified numbers in [0, 1), four per ray.
fn random(index: u32, stream: u32) -> [f32; 4] {
    sobol_burley::sample_4d(index & 0xffff, 0, (index >> 16) ^ (stream << 20))
}

/// Camera rays through the pixel centres of `camera`, row by row.
fn coherent(camera: &Camera) -> Vec<Ray> {
    let [width, height] = [camera.intrinsics.width, camera.intrinsics.height];
    let ray = |x: u32, y: u32| {
        let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        Ray::endless(camera.position().as_vec3(), camera.direction(place).as_vec3())
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| ray(x, y)).collect()
}

/// Rays from uniform points in the scene's box, in uniform directions.
fn uniform(accel: &Accel, count: u32) -> Vec<Ray> {
    let [low, high] = accel.bounds();
    let ray = |index: u32| {
        let [x, y, z, _] = random(index, 1);
        Ray::endless(low + (high - low) * Vec3::new(x, y, z), sphere(random(index, 2)))
    };
    (0..count).map(ray).collect()
}

/// Rays from the hits of `rays` into the half-space that each ray came from.
fn bounced(accel: &Accel, rays: &[Ray]) -> Vec<Ray> {
    let bounce = |(index, ray): (usize, &Ray)| {
        let hit = accel.closest(ray)?;
        let direction = (sphere(random(index as u32, 3)) - ray.direction()).try_normalize()?;
        Some(Ray::endless(ray.at(hit.distance - 1e-3), direction))
    };
    rays.iter().enumerate().filter_map(bounce).collect()
}

/// Rays from the hits of `rays` to a point below the top of the scene's box, by a tenth of its height.
fn towards_ceiling(accel: &Accel, rays: &[Ray], up: Vec3) -> Vec<Ray> {
    let [low, high] = accel.bounds();
    let shadow = |(index, ray): (usize, &Ray)| {
        let from = ray.at(accel.closest(ray)?.distance - 1e-3);
        let [x, y, z, _] = random(index as u32, 4);
        let inside = low + (high - low) * (Vec3::splat(0.1) + Vec3::new(x, y, z) * 0.8);
        let lamp = inside + up * (high.dot(up) - 0.1 * (high - low).dot(up) - inside.dot(up));
        let towards = lamp - from;
        Some(Ray::new(from, towards.try_normalize()?, towards.length()))
    };
    rays.iter().enumerate().filter_map(shadow).collect()
}

/// The same rays, each limited to `reach` metres.
fn shortened(rays: &[Ray], reach: f32) -> Vec<Ray> {
    rays.iter().map(|ray| Ray::new(ray.origin(), ray.direction(), reach)).collect()
}

fn sphere([a, b, ..]: [f32; 4]) -> Vec3 {
    let z = 1.0 - 2.0 * a;
    let (sin, cos) = libm::sincosf(std::f32::consts::TAU * b);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}
