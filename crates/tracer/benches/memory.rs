//! Peak memory by triangles, emitters and resolution: `cargo bench -p mateval-tracer --bench memory`.
//!
//! Each case is a separate process, which creates a room, renders a light basis with one sample per pixel and reports
//! its peak resident memory (Linux only). The memory of the pictures is known beforehand and limited. A case fails if
//! it takes more than the sum of that limit, the unfinished tiles, and the memory of the same triangles with almost no
//! pictures.
#![allow(clippy::unwrap_used, reason = "a bench that cannot be set up has failed")]
#![allow(clippy::print_stdout, reason = "a bench prints")]

use std::process::Command;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use mateval_dataset::material::{ColorInput, Material, MaterialModel};
use mateval_dataset::reference::{Emission, LightGroup, MaterialIndex, ReferenceScene, Surface, SurfaceIndex};
use mateval_dataset::{Camera, Intrinsics, TriangleMesh};
use mateval_tracer::{LightGroups, RenderSettings, World, render_views};

/// The render of one process.
#[derive(Clone, Copy)]
struct Case {
    triangles: u32,
    lights: u32,
    size: [u32; 2],
    /// The limit on the light basis, in bytes.
    bytes: u64,
}

/// The measurements of one process.
struct Taken {
    peak: u64,
    groups: u64,
}

const TINY: [u32; 2] = [64, 36];
const USUAL: [u32; 2] = [480, 270];
const BOUND: u64 = mateval_tracer::light_basis::DEFAULT_BASIS_BYTES;
const OFFSETS: [[f64; 2]; 5] = [[0.0, 0.0], [5.0, 5.0], [5.0, -5.0], [-5.0, 5.0], [-5.0, -5.0]];
const HALVES: u64 = 2;
const MIB: f64 = 1024.0 * 1024.0;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match words.iter().position(|word| word == "--case") {
        Some(place) => child(&words[place + 1..]),
        None if words.iter().any(|word| word == "--bench") => parent(),
        None => println!("memory: nothing is measured unless run by `cargo bench`"),
    }
}

fn parent() {
    println!("| triangles | lights | pixels | bound MiB | groups | pictures MiB | peak MiB | bytes a triangle |");
    println!("|---|---|---|---|---|---|---|---|");
    let case = |triangles, lights, size, bytes| Case { triangles, lights, size, bytes };
    let empty = run(case(2, 1, TINY, BOUND)).peak;
    for triangles in [20_000, 1_000_000, 3_000_000] {
        let case = case(triangles, 1, TINY, BOUND);
        let taken = run(case);
        let each = (taken.peak - empty) as f64 / f64::from(triangles);
        row(case, &taken, &format!("{each:.0}"));
        assert!(triangles < 1_000_000 || each < 600.0, "{each} bytes a triangle");
    }
    let room = run(case(20_000, 1, TINY, BOUND)).peak;
    let lights = [1, 16, 64, 138, 256].map(|lights| case(20_000, lights, USUAL, BOUND));
    let sizes = [[240, 135], [960, 540]].map(|size| case(20_000, 16, size, BOUND));
    for case in lights.into_iter().chain(sizes).chain([case(20_000, 256, USUAL, 256 << 20)]) {
        let taken = run(case);
        row(case, &taken, "");
        let pictures = pictures(case, taken.groups);
        assert!(pictures <= case.bytes);
        let threads = std::thread::available_parallelism().unwrap().get() as u64;
        // Unfinished tiles, and a tenth of the pictures for path counts and for memory that the allocator retains.
        let most =
            room + pictures + pictures / 10 + 64_000 * OFFSETS.len() as u64 * taken.groups * threads + (32 << 20);
        assert!(taken.peak <= most, "{} bytes taken, {most} expected at most", taken.peak);
    }
}

fn pictures(case: Case, groups: u64) -> u64 {
    12 * HALVES * OFFSETS.len() as u64 * u64::from(case.size[0]) * u64::from(case.size[1]) * groups
}

fn row(case: Case, taken: &Taken, each: &str) {
    let Case { triangles, lights, size: [width, height], bytes } = case;
    let mib = |bytes: u64| bytes as f64 / MIB;
    let (groups, bound, peak) = (taken.groups, mib(bytes), mib(taken.peak));
    let pictures = mib(pictures(case, groups));
    println!(
        "| {triangles} | {lights} | {width} x {height} | {bound:.0} | {groups} | {pictures:.0} | {peak:.0} | {each} |"
    );
}

fn run(case: Case) -> Taken {
    let Case { triangles, lights, size: [width, height], bytes } = case;
    let words = [u64::from(triangles), u64::from(lights), u64::from(width), u64::from(height), bytes];
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.arg("--case").args(words.map(|word| word.to_string()));
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let numbers: Vec<u64> =
        String::from_utf8(output.stdout).unwrap().split_whitespace().map(|word| word.parse().unwrap()).collect();
    Taken { peak: numbers[0], groups: numbers[1] }
}

fn child(words: &[String]) {
    let numbers: Vec<u64> = words.iter().map(|word| word.parse().unwrap()).collect();
    let (triangles, lights, size) = (numbers[0] as u32, numbers[1] as u32, [numbers[2] as u32, numbers[3] as u32]);
    let world = World::new(Arc::new(room(triangles, lights))).unwrap();
    let intrinsics = Intrinsics::from_fov_x(size[0], size[1], 1.0);
    let input = Camera::look_at(DVec3::new(0.0, 1.6, 3.0), DVec3::new(0.0, 1.0, 0.0), DVec3::Y, intrinsics).unwrap();
    let cameras = OFFSETS.map(|[x, y]| input.turned(x, y));
    let groups = LightGroups::within(numbers[4], lights as usize, &cameras, HALVES as usize).unwrap();
    let settings = RenderSettings { samples: 1, max_bounces: 2, ..Default::default() };
    let done = render_views(&world, &cameras, &groups, &settings, &[1, 2], &|_, _| ()).unwrap();
    assert_eq!(done.passes, 1);
    println!("{} {}", peak_bytes(), groups.groups().len());
}

/// A bumpy floor of `triangles` triangles under `lights` small lamps.
fn room(triangles: u32, lights: u32) -> ReferenceScene {
    let model = MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.6; 3]), alpha: None };
    let grey = Material { name: String::new(), model, two_sided: true, opacity: None, bump: None };
    let mut scene = ReferenceScene { materials: vec![grey], ..Default::default() };
    let mut add = |mesh| scene.surfaces.push(Surface { name: String::new(), mesh, material: MaterialIndex(0) });
    add(floor(triangles));
    let side = f64::from(lights).sqrt().ceil() as u32;
    for light in 0..lights {
        let at = |k: u32| 8.0 * (k as f32 + 0.25) / side as f32 - 4.0;
        add(lamp(Vec3::new(at(light % side), 2.5, at(light / side)), 4.0 / side as f32));
    }
    let group = |light: u32| LightGroup {
        name: String::new(),
        emission: Emission::Area {
            surfaces: vec![SurfaceIndex(light as usize + 1)],
            radiance: [3.0; 3],
            map: None,
            two_sided: true,
        },
        camera_visible: true,
    };
    scene.lights = (0..lights).map(group).collect();
    scene
}

/// Adds normals and uvs, as real meshes have them.
fn floor(triangles: u32) -> TriangleMesh {
    let side = (f64::from(triangles) / 2.0).sqrt().ceil() as u32;
    let vertex = |x: u32, z: u32| {
        let (u, v) = (x as f32 / side as f32, z as f32 / side as f32);
        let height = 0.1 * libm::sinf(40.0 * u) * libm::sinf(40.0 * v);
        (Vec3::new(8.0 * u - 4.0, height, 8.0 * v - 4.0), Vec2::new(u, v))
    };
    let vertices: Vec<(Vec3, Vec2)> = (0..=side).flat_map(|z| (0..=side).map(move |x| vertex(x, z))).collect();
    let at = |x: u32, z: u32| z * (side + 1) + x;
    let quads = (0..side).flat_map(|z| (0..side).map(move |x| (x, z)));
    let halves = quads
        .flat_map(|(x, z)| [[at(x, z), at(x, z + 1), at(x + 1, z)], [at(x + 1, z), at(x, z + 1), at(x + 1, z + 1)]]);
    TriangleMesh {
        triangles: halves.take(triangles as usize).collect(),
        normals: Some(vec![Vec3::Y; vertices.len()]),
        uvs: Some(vertices.iter().map(|vertex| vertex.1).collect()),
        positions: vertices.into_iter().map(|vertex| vertex.0).collect(),
    }
}

fn lamp(corner: Vec3, side: f32) -> TriangleMesh {
    let (x, z) = (Vec3::X * side, Vec3::Z * side);
    let positions = vec![corner, corner + x, corner + x + z, corner + z];
    TriangleMesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Default::default() }
}

/// Peak resident memory, from Linux' `/proc`.
fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<u64>().unwrap() * 1024
}
