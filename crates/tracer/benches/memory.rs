//! Peak memory by triangles, emitters and resolution: `cargo bench -p mateval-tracer --bench memory`.
//!
//! Each case is a separate process, which creates a room, renders a light basis with one sample per pixel and reports
//! its peak resident memory (Linux only). The memory of the pictures is known beforehand. A case fails if it takes more
//! than the sum of them, the unfinished tiles, and the memory of the same triangles with almost no pictures.
#![allow(clippy::unwrap_used, reason = "a bench that cannot be set up has failed")]
#![allow(clippy::print_stdout, reason = "a bench prints")]

use std::process::Command;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use mateval_dataset::material::{ColorInput, Material, MaterialModel};
use mateval_dataset::reference::{Emission, LightGroup, MaterialIndex, ReferenceScene, Surface, SurfaceIndex};
use mateval_dataset::{Camera, Intrinsics, TriangleMesh};
use mateval_tracer::{RenderSettings, World, render_views};

/// The render of one process.
#[derive(Clone, Copy)]
struct Case {
    triangles: u32,
    lights: u32,
    size: [u32; 2],
}

const TINY: [u32; 2] = [64, 36];
const USUAL: [u32; 2] = [480, 270];
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
    println!("| triangles | lights | pixels | pictures MiB | peak MiB | bytes a triangle |");
    println!("|---|---|---|---|---|---|");
    let case = |triangles, lights, size| Case { triangles, lights, size };
    let empty = run(case(2, 1, TINY));
    for triangles in [20_000, 1_000_000, 3_000_000] {
        let case = case(triangles, 1, TINY);
        let peak = run(case);
        let each = (peak - empty) as f64 / f64::from(triangles);
        row(case, peak, &format!("{each:.0}"));
        assert!(triangles < 1_000_000 || each < 600.0, "{each} bytes a triangle");
    }
    let room = run(case(20_000, 1, TINY));
    let lights = [1, 16, 64, 138].map(|lights| case(20_000, lights, USUAL));
    let sizes = [[240, 135], [960, 540]].map(|size| case(20_000, 16, size));
    for case in lights.into_iter().chain(sizes) {
        let peak = run(case);
        row(case, peak, "");
        let pictures = pictures(case);
        let threads = std::thread::available_parallelism().unwrap().get() as u64;
        // Unfinished tiles, and a tenth of the pictures for memory that the allocator retains.
        let tiles = 64_000 * OFFSETS.len() as u64 * u64::from(case.lights) * threads;
        let most = room + pictures + pictures / 10 + tiles + (32 << 20);
        assert!(peak <= most, "{peak} bytes taken, {most} expected at most");
    }
}

fn pictures(Case { lights, size: [width, height], .. }: Case) -> u64 {
    12 * HALVES * OFFSETS.len() as u64 * [width, height, lights].map(u64::from).iter().product::<u64>()
}

fn row(case: Case, peak: u64, each: &str) {
    let Case { triangles, lights, size: [width, height] } = case;
    let [pictures, peak] = [pictures(case), peak].map(|bytes| bytes as f64 / MIB);
    println!("| {triangles} | {lights} | {width} x {height} | {pictures:.0} | {peak:.0} | {each} |");
}

/// The peak memory of a process of this case, in bytes.
fn run(Case { triangles, lights, size: [width, height] }: Case) -> u64 {
    let words = [triangles, lights, width, height];
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.arg("--case").args(words.map(|word| word.to_string()));
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().trim().parse().unwrap()
}

fn child(words: &[String]) {
    let numbers: Vec<u32> = words.iter().map(|word| word.parse().unwrap()).collect();
    let (triangles, lights, size) = (numbers[0], numbers[1], [numbers[2], numbers[3]]);
    let world = World::new(Arc::new(room(triangles, lights))).unwrap();
    let intrinsics = Intrinsics::from_fov_x(size[0], size[1], 1.0);
    let input = Camera::look_at(DVec3::new(0.0, 1.6, 3.0), DVec3::new(0.0, 1.0, 0.0), DVec3::Y, intrinsics).unwrap();
    let cameras = OFFSETS.map(|[x, y]| input.turned(x, y));
    let settings = RenderSettings { samples: 1, max_bounces: 2, ..Default::default() };
    let done = render_views(&world, &cameras, &settings, &[1, 2], &|_, _| ()).unwrap();
    assert_eq!(done.views.len(), OFFSETS.len());
    println!("{}", peak_bytes());
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
