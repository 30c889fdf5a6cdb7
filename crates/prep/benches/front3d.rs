//! Where the time of a 3D-FRONT scene goes: reading the JSON, reading models and textures, the hierarchy, what the views
//! see, atlases, baking. `cargo bench -p mateval-prep --bench front3d [-- ROUNDS]`: the test kit's house of three
//! rooms, and the houses of the shared data where they are. CPU seconds of the whole process; medians.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]

use std::path::Path;

use cpu_time::ProcessTime;
use glam::DVec3;
use mateval_dataset::camera::{Camera, Intrinsics};
use mateval_prep::atlas::{SizeWish, unwrap};
use mateval_prep::build::baking::bake;
use mateval_sources::front3d::room_scene::room_scene;
use mateval_sources::front3d::{AppearanceRule, HouseFiles, Limits, furnish, read_house};
use mateval_testkit::faulty_house;
use mateval_testkit::shared_data;
use mateval_tracer::World;

const STAGES: [&str; 6] =
    ["JSON", "house with models and textures", "hierarchy", "room and its views", "atlases", "baking"];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let rounds: usize = words.first().map_or(3, |word| word.parse().unwrap());
    let sample = tempfile::tempdir().unwrap();
    faulty_house::write(sample.path());
    measure(&files(&sample.path().join("house"), "cc000000-5a3b-4e00-8000-000000000001", true), rounds);
    let Some(shared) = shared_data("3d-front") else { return };
    for uid in ["07700701-1835-4532-8af0-bd8c7f624b1b", "dc74ad5c-34cf-4237-a3f3-a94297a907c8"] {
        measure(&files(&shared, uid, false), rounds);
    }
}

fn files(root: &Path, uid: &str, textures: bool) -> HouseFiles {
    HouseFiles {
        root: root.to_owned(),
        house: format!("3D-FRONT/{uid}.json").into(),
        models: "3D-FUTURE-model".into(),
        textures: textures.then(|| "3D-FRONT-texture".into()),
        cameras: None,
        blenderproc_compat: false,
        appearance: AppearanceRule::Constant,
    }
}

fn measure(files: &HouseFiles, rounds: usize) {
    let mut seconds: Vec<[f64; 6]> = (0..rounds).map(|_| stages(files)).collect();
    let house = furnish(files, &Limits::default()).unwrap();
    let triangles: usize = house.scene.surfaces.iter().map(|surface| surface.mesh.triangles.len()).sum();
    println!("{}: {} surfaces, {triangles} triangles", files.house.display(), house.scene.surfaces.len());
    for (stage, name) in STAGES.iter().enumerate() {
        seconds.sort_by(|a, b| a[stage].total_cmp(&b[stage]));
        println!("  {:>8.3} s {name}", seconds[rounds / 2][stage]);
    }
}

/// CPU seconds of each stage, for the room with most furniture, from a corner of it.
fn stages(files: &HouseFiles) -> [f64; 6] {
    let mut seconds = [0.0; 6];
    let mut since = ProcessTime::now();
    let mut note = |stage: usize| {
        seconds[stage] = since.elapsed().as_secs_f64();
        since = ProcessTime::now();
    };
    read_house(&files.root.join(&files.house), &Limits::default()).unwrap();
    note(0);
    let house = furnish(files, &Limits::default()).unwrap();
    note(1);
    let world = World::new(house.scene.clone()).unwrap();
    note(2);
    let room = (0..house.wanted_pieces.len()).max_by_key(|&room| house.wanted_pieces[room]).unwrap();
    let views = views(&house, room);
    let scene = room_scene(&house, &world, room, &views).read.scene;
    note(3);
    let unwrapped: Vec<_> = scene
        .surfaces
        .iter()
        .filter_map(|surface| unwrap(&surface.mesh, SizeWish::Fixed(1024)).ok().map(|u| (surface, u)))
        .collect();
    note(4);
    let textures = scene.texture_list();
    for (surface, unwrapped) in &unwrapped {
        bake(unwrapped, &surface.mesh, &scene.materials[surface.material.0], &textures);
    }
    note(5);
    seconds
}

/// Five views from the room's first piece of furniture's far corner, as large as the benchmark's.
fn views(house: &mateval_sources::front3d::FurnishedHouse, room: usize) -> Vec<Camera> {
    let own = (0..house.placed.len()).filter(|&surface| house.placed[surface].room == room);
    let points: Vec<DVec3> =
        own.flat_map(|surface| house.scene.surfaces[surface].mesh.positions.iter().map(|p| p.as_dvec3())).collect();
    let low = points.iter().copied().reduce(DVec3::min).unwrap();
    let high = points.iter().copied().reduce(DVec3::max).unwrap();
    let eye = DVec3::new(low.x + 0.5, low.y + 1.5, low.z + 0.5);
    let intrinsics = Intrinsics::from_fov_y(480, 270, 45_f64.to_radians());
    let input = Camera::look_at(eye, (low + high) / 2.0, DVec3::Y, intrinsics).unwrap();
    let turns = [[5.0, 5.0], [5.0, -5.0], [-5.0, 5.0], [-5.0, -5.0]];
    std::iter::once(input).chain(turns.map(|[x, y]| input.turned(x, y))).collect()
}
