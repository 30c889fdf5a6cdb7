//! Blender 4.5 (Cycles) renders scenes that are made here, and so does the tracer: they must agree tile by tile.
//!
//! Every render is made with several seeds, which say how noisy it is. Samples are set so that the noise of a tile, of both
//! renderers together, is at most a third of what tiles may differ by.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use glam::Vec3;
use mateval_image::{LinearRgb, Picture};
use mateval_scene::material::{ColorInput, MaterialModel, PrincipledFlavour, ScalarInput};
use mateval_scene::reference::{Emission, ReferenceScene};
use mateval_scene::{Camera, TriangleMesh};
use mateval_tracer::{RenderSettings, World, render};
use serde_json::{Value, json};

use super::python;
use crate::scenes::{Builder, camera, grey, material, quad, room, sphere};

/// Pixels a side of every picture, and of a tile.
const SIZE: usize = 64;
const TILE: usize = 8;
/// Renders of each picture, by either renderer.
const SEEDS: u64 = 4;
const BOUNCES: u32 = 16;

/// A scene, where it is seen from and how many samples a seed gets.
struct Shot {
    name: String,
    scene: ReferenceScene,
    camera: Camera,
    samples: u32,
}

/// The tiles' means over pixels and channels, render by render.
struct Tiles(Vec<Vec<f64>>);

/// How two renderers agree.
#[derive(Debug)]
struct Agreement {
    /// The difference of the means of whole pictures, and its standard error; relative.
    whole: f64,
    whole_error: f64,
    /// Root of the mean square of the tiles' relative standard errors.
    noise: f64,
    /// Which difference 99 % of tiles stay within.
    most: f64,
    /// The largest.
    worst: f64,
}

impl Tiles {
    fn of(pictures: &[Picture<LinearRgb>]) -> Self {
        let tiles = |picture: &Picture<LinearRgb>| {
            let side = SIZE / TILE;
            (0..side * side).map(|tile| tile_mean(picture, tile % side * TILE, tile / side * TILE)).collect()
        };
        Self(pictures.iter().map(tiles).collect())
    }

    /// The mean over renders of each tile, and the square of its standard error.
    fn estimates(&self) -> Vec<(f64, f64)> {
        let n = self.0.len() as f64;
        let estimate = |tile: usize| {
            let mean = self.0.iter().map(|render| render[tile]).sum::<f64>() / n;
            let spread = self.0.iter().map(|render| (render[tile] - mean).powi(2)).sum::<f64>();
            (mean, spread / (n - 1.0) / n)
        };
        (0..self.0[0].len()).map(estimate).collect()
    }
}

fn tile_mean(picture: &Picture<LinearRgb>, left: usize, top: usize) -> f64 {
    let pixels = (0..TILE * TILE).map(|k| picture.get(left + k % TILE, top + k / TILE).0);
    pixels.flatten().map(f64::from).sum::<f64>() / (3 * TILE * TILE) as f64
}

fn agreement(ours: &Tiles, theirs: &Tiles) -> Agreement {
    let (ours, theirs) = (ours.estimates(), theirs.estimates());
    let count = ours.len() as f64;
    let sum = |tiles: &[(f64, f64)], pick: fn(&(f64, f64)) -> f64| tiles.iter().map(pick).sum::<f64>();
    let (our_sum, their_sum) = (sum(&ours, |t| t.0), sum(&theirs, |t| t.0));
    let variance = sum(&ours, |t| t.1) + sum(&theirs, |t| t.1);
    let pairs = || ours.iter().zip(&theirs);
    let mut off: Vec<f64> = pairs().map(|(a, b)| (a.0 / b.0 - 1.0).abs()).collect();
    off.sort_by(f64::total_cmp);
    Agreement {
        whole: our_sum / their_sum - 1.0,
        whole_error: variance.sqrt() / their_sum,
        noise: (pairs().map(|(a, b)| (a.1 + b.1) / (b.0 * b.0)).sum::<f64>() / count).sqrt(),
        most: off[(0.99 * count) as usize - 1],
        worst: off[off.len() - 1],
    }
}

/// The tracer's renders.
fn trace(shot: &Shot) -> Tiles {
    let world = World::new(std::sync::Arc::new(shot.scene.clone())).unwrap();
    let one = |seed: u64| {
        let settings = RenderSettings { samples: shot.samples, seed, max_bounces: BOUNCES, ..Default::default() };
        let done = render(&world, &shot.camera, &settings, &|_, _| ()).unwrap();
        assert_eq!(done.stats.not_finite, 0);
        done.picture
    };
    Tiles::of(&(0..SEEDS).map(one).collect::<Vec<_>>())
}

/// Blender's renders of all shots, one after the other.
fn blender(shots: &[Shot]) -> Vec<Tiles> {
    // Blender uses every processor: two at once would only take more memory.
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock();
    let folder = tempfile::tempdir().unwrap();
    let result = folder.path().join("result.f32");
    let pictures: Vec<Value> = shots
        .iter()
        .enumerate()
        .map(|(index, shot)| {
            let folder = folder.path().join(index.to_string());
            std::fs::create_dir(&folder).unwrap();
            job(shot, &folder)
        })
        .collect();
    let path = folder.path().join("job.json");
    std::fs::write(&path, json!({ "result": result, "pictures": pictures }).to_string()).unwrap();
    python::run("render_blender.py", &path);
    let pictures = read_pictures(&result);
    assert_eq!(pictures.len(), shots.len() * SEEDS as usize);
    pictures.chunks(SEEDS as usize).map(Tiles::of).collect()
}

fn read_pictures(path: &Path) -> Vec<Picture<LinearRgb>> {
    let bytes = std::fs::read(path).unwrap();
    let numbers: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let picture = |numbers: &[f32]| {
        Picture::from_fn(SIZE, SIZE, |x, y| {
            let start = 3 * (y * SIZE + x);
            LinearRgb(numbers[start..start + 3].try_into().unwrap())
        })
    };
    numbers.chunks_exact(3 * SIZE * SIZE).map(picture).collect()
}

/// One picture of a job for `render_blender.py`; meshes go to files in `folder`.
fn job(shot: &Shot, folder: &Path) -> Value {
    let scene = &shot.scene;
    let mut world = [0.0; 3];
    let mut lamps = vec![(Value::Null, true); scene.surfaces.len()];
    for light in &scene.lights {
        match &light.emission {
            Emission::Area { surfaces, radiance, two_sided } => {
                assert!(two_sided, "Blender's lamps glow on both sides");
                surfaces.iter().for_each(|surface| lamps[surface.0] = (json!(radiance), light.camera_visible));
            }
            Emission::Constant { radiance } => world = *radiance,
            Emission::Environment { .. } => unreachable!("no scene here has a map"),
        }
    }
    let material = |index: usize| {
        let mut spec = material_job(&scene.materials[scene.surfaces[index].material.0].model);
        (spec["radiance"], spec["camera_visible"]) = (lamps[index].0.clone(), json!(lamps[index].1));
        spec
    };
    json!({
        "materials": (0..scene.surfaces.len()).map(material).collect::<Vec<_>>(),
        "surfaces": (0..scene.surfaces.len()).map(|k| surface_job(&scene.surfaces[k].mesh, k, folder)).collect::<Vec<_>>(),
        "world": world,
        "camera": {
            "world_from_camera": shot.camera.world_from_camera,
            "fov_x": 2.0 * libm::atan(0.5 * SIZE as f64 / shot.camera.intrinsics.fx),
            "size": SIZE,
        },
        "samples": shot.samples,
        "seeds": (1..=SEEDS).collect::<Vec<_>>(),
        "bounces": BOUNCES,
    })
}

fn material_job(model: &MaterialModel) -> Value {
    match model {
        MaterialModel::Diffuse { reflectance: ColorInput::Constant(color), alpha: None } => {
            json!({ "base_color": color, "roughness": null })
        }
        MaterialModel::Principled {
            base_color: ColorInput::Constant(color),
            roughness: ScalarInput::Constant(roughness),
            metallic: ScalarInput::Constant(metallic),
            specular,
            flavour: _,
        } => json!({ "base_color": color, "roughness": roughness, "metallic": metallic, "specular": specular }),
        other => unreachable!("no scene here is made of {other:?}"),
    }
}

fn surface_job(mesh: &TriangleMesh, index: usize, folder: &Path) -> Value {
    let write = |name: &str, bytes: Vec<u8>| -> PathBuf {
        let path = folder.join(format!("{index}.{name}"));
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let floats = |vectors: &[Vec3]| vectors.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes).collect();
    let triangles = mesh.triangles.iter().flatten().flat_map(|corner| corner.to_le_bytes()).collect();
    json!({
        "material": index,
        "positions": write("positions", floats(&mesh.positions)),
        "normals": mesh.normals.as_ref().map(|normals| write("normals", floats(normals))),
        "triangles": write("triangles", triangles),
    })
}

fn principled(base_color: [f32; 3], roughness: f32, metallic: f32) -> mateval_scene::material::Material {
    material(MaterialModel::Principled {
        base_color: ColorInput::Constant(base_color),
        roughness: ScalarInput::Constant(roughness),
        metallic: ScalarInput::Constant(metallic),
        specular: 0.5,
        flavour: PrincipledFlavour::Blender,
    })
}

fn lamp(corner: Vec3, u: Vec3, v: Vec3, radiance: [f32; 3], builder: Builder) -> Builder {
    builder.surface(quad(corner, u, v), grey(0.0)).glowing_on_both_sides(radiance)
}

/// A ball between a warm lamp, a cool one and dim light from all around.
fn ball(roughness: f32, metallic: f32) -> Shot {
    let builder = Builder::default()
        .surface(sphere(Vec3::ZERO, 1.0, 96), principled([0.8, 0.5, 0.3], roughness, metallic))
        .light(Emission::Constant { radiance: [0.2, 0.25, 0.3] });
    let builder = lamp(Vec3::new(-3.0, 1.5, 0.5), Vec3::Z * 2.0, Vec3::new(1.0, 1.5, 0.0), [9.0, 7.0, 5.0], builder);
    let builder = lamp(Vec3::new(2.5, -1.0, -1.0), Vec3::Z * 2.0, Vec3::Y * 2.0, [2.0, 3.0, 4.0], builder);
    Shot {
        name: format!("ball, roughness {roughness}, metallic {metallic}"),
        scene: builder.scene(),
        camera: camera([0.0, 0.5, 5.0], [0.0; 3], SIZE as u32, 26.0),
        samples: 32,
    }
}

/// A closed room with a box and a ball in it, all of one roughness and metallic.
fn furnished(roughness: f32, metallic: f32) -> Shot {
    let colors = [[0.7, 0.6, 0.5], [0.8; 3], [0.7, 0.3, 0.2], [0.3, 0.6, 0.3], [0.7; 3], [0.6, 0.7, 0.8]];
    let walls = room().into_iter().zip(colors);
    let builder = walls.fold(Builder::default(), |builder, (wall, color)| {
        builder.surface(wall, principled(color, roughness, metallic))
    });
    let builder = builder
        .surface(sphere(Vec3::new(0.35, -0.6, 0.1), 0.4, 64), principled([0.8, 0.7, 0.3], roughness, metallic))
        .surface(
            quad(Vec3::new(-0.9, -0.4, -0.5), Vec3::Z * 0.6, Vec3::X * 0.8),
            principled([0.4, 0.3, 0.6], roughness, metallic),
        );
    let builder = lamp(Vec3::new(-0.5, 0.9, -0.5), Vec3::X, Vec3::Z, [4.0, 3.8, 3.5], builder);
    Shot {
        name: format!("room, roughness {roughness}, metallic {metallic}"),
        scene: builder.scene(),
        camera: camera([0.1, 0.1, 0.95], [0.0, -0.2, 0.0], SIZE as u32, 75.0),
        samples: 32,
    }
}

#[test]
fn explore() {
    let mut shots = Vec::new();
    for metallic in [0.0, 1.0] {
        for roughness in [0.1, 0.5, 0.9] {
            shots.push(ball(roughness, metallic));
            shots.push(furnished(roughness, metallic));
        }
    }
    let start = std::time::Instant::now();
    let theirs = blender(&shots);
    eprintln!("blender {:?}", start.elapsed());
    for (shot, theirs) in shots.iter().zip(&theirs) {
        let start = std::time::Instant::now();
        let ours = trace(shot);
        eprintln!("{}: {:.2?} {:?}", shot.name, agreement(&ours, theirs), start.elapsed());
    }
}
