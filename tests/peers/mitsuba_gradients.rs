//! Derivatives by base colours compared with Mitsuba's path replay backpropagation (`prb`; Vicini et al., SIGGRAPH
//! 2021).

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use mateval_audit::mitsuba_export::export;
use mateval_scene::material::{ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput};
use mateval_scene::reference::{Emission, ReferenceScene, SurfaceIndex};
use mateval_scene::{Camera, Intrinsics, Severity};
use mateval_testkit::scenes::{Builder, grey, material, quad, room, sphere};
use mateval_testkit::statistics::{Estimate, chi_square_z};
use mateval_tracer::{RenderSettings, World, part_jacobian};

use super::python;

/// Independent estimates of each side.
const SEEDS: u32 = 64;
const WIDTH: u32 = 24;
const HEIGHT: u32 = 12;
/// Two blocks: the left half of the picture and the right half.
const BLOCK: usize = 12;
const BLOCKS: usize = 2;
const SAMPLES: u32 = 64;
/// The surfaces, each of which has its own material.
const PARTS: usize = 8;

/// Estimates in the order of block, surface and channel.
type Derivatives = Vec<Estimate>;

fn diffuse(reflectance: [f32; 3]) -> Material {
    material(MaterialModel::Diffuse { reflectance: ColorInput::Constant(reflectance), alpha: None })
}

fn principled(color: [f32; 3], roughness: f32, metallic: f32) -> Material {
    material(MaterialModel::Principled {
        base_color: ColorInput::Constant(color),
        roughness: ScalarInput::Constant(roughness),
        metallic: ScalarInput::Constant(metallic),
        specular: 0.5,
        flavour: PrincipledFlavour::Mitsuba,
    })
}

/// Five walls of a room, open to a dim sky behind the camera, with a metal ball, a glossy ball and a lamp.
///
/// The darkest channel is 0.02 and not black: `prb` scales the light that a path brings, which a black channel makes 0,
/// and so loses the derivative of indirect light by it.
fn scene() -> ReferenceScene {
    let walls = [
        diffuse([0.5, 0.6, 0.7]),
        diffuse([0.8; 3]),
        principled([0.7, 0.2, 0.1], 0.6, 0.0),
        principled([0.3, 0.5, 0.8], 0.4, 0.5),
        diffuse([0.6, 0.02, 0.02]),
    ];
    let mut builder = Builder::default();
    for (mesh, wall) in room().into_iter().zip(walls) {
        builder = builder.surface(mesh, wall);
    }
    let ball = |x: f32| {
        let mut mesh = sphere(Vec3::new(x, -0.6, -0.2), 0.35, 8);
        mesh.normals = None;
        mesh
    };
    builder = builder
        .surface(ball(-0.45), principled([0.9, 0.7, 0.4], 0.3, 1.0))
        .surface(ball(0.45), principled([0.2, 0.5, 0.3], 0.25, 0.0));
    let lamp = quad(Vec3::new(-0.4, 0.9, -0.6), Vec3::X * 0.8, Vec3::Z * 0.8);
    let builder = builder.surface(lamp, grey(0.3)).glowing([5.0, 4.5, 4.0]);
    builder.light(Emission::Constant { radiance: [0.3, 0.35, 0.4] }).scene()
}

fn view() -> Camera {
    let intrinsics = Intrinsics::from_fov_x(WIDTH, HEIGHT, 0.9);
    let (position, target) = (glam::DVec3::new(0.1, 0.0, 2.6), glam::DVec3::new(0.0, -0.1, 0.0));
    Camera::look_at(position, target, glam::DVec3::Y, intrinsics).unwrap()
}

fn settings(seed: u32) -> RenderSettings {
    RenderSettings { samples: SAMPLES, seed: u64::from(seed), max_bounces: 6, ..Default::default() }
}

/// One estimate for each derivative from its values for all seeds, which lie one after another.
fn estimates(values: &[f64]) -> Derivatives {
    let count = BLOCKS * PARTS * 3;
    assert_eq!(values.len(), count * SEEDS as usize);
    let of = |at: usize| Estimate::of(&values.iter().skip(at).step_by(count).copied().collect::<Vec<_>>());
    (0..count).map(of).collect()
}

fn theirs(folder: &Path) -> Derivatives {
    let scene = scene();
    assert_eq!(scene.materials.len(), PARTS);
    let findings = export(&scene, &view(), &settings(0), &folder.join("scene")).unwrap();
    assert!(findings.iter().all(|finding| finding.severity == Severity::Note), "{findings:?}");
    let (file, out, job) = (folder.join("scene/scene.xml"), folder.join("out.raw"), folder.join("job.json"));
    let seeds: Vec<u32> = (0..SEEDS).map(|seed| 1000 + seed).collect();
    // Mitsuba's max_depth is larger by 2.
    let depth = settings(0).max_bounces + 2;
    let request = serde_json::json!({
        "scene": file, "out": out, "seeds": seeds, "samples": SAMPLES, "max_depth": depth, "block": BLOCK,
        "materials": PARTS,
    });
    std::fs::write(&job, request.to_string()).unwrap();
    python::run("gradients_mitsuba.py", &job);
    let bytes = std::fs::read(out).unwrap();
    let values = bytes.as_chunks::<4>().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes)));
    estimates(&values.collect::<Vec<_>>())
}

fn ours(scene: ReferenceScene) -> Derivatives {
    let world = World::new(Arc::new(scene)).unwrap();
    let mut values = Vec::new();
    for seed in 0..SEEDS {
        let found = part_jacobian(&world, &view(), BLOCK, &settings(1 + seed), &|_, _| ()).unwrap();
        for (block, part) in (0..BLOCKS).flat_map(|block| (0..PARTS).map(move |part| (block, part))) {
            values.extend(found.at([block, 0], SurfaceIndex(part)).map(f64::from));
        }
    }
    estimates(&values)
}

/// The largest |z| of all derivatives, and their chi-square as a standard normal. Prints a line for each part.
fn compare(name: &str, ours: &[Estimate], theirs: &[Estimate]) -> (f64, f64) {
    let z: Vec<f64> = ours.iter().zip(theirs).map(|(ours, theirs)| ours.z_against(theirs)).collect();
    for (at, z) in z.chunks(3).enumerate() {
        let values = [&ours[3 * at..3 * at + 3], &theirs[3 * at..3 * at + 3]].map(|side| side[0].mean);
        let (block, part) = (at / PARTS, at % PARTS);
        eprintln!("{name} block {block} part {part}: ours {:.5} theirs {:.5} z {z:.2?}", values[0], values[1]);
    }
    let worst = z.iter().fold(0.0_f64, |worst, z| worst.max(z.abs()));
    let mean = z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
    let chi_square = chi_square_z(mean, z.len() as f64);
    eprintln!("{name}: worst |z| {worst:.2}, mean square {mean:.3}, chi-square as a normal {chi_square:.2}");
    (worst, chi_square)
}

/// Both sides have the same derivatives: |z| < 4 for every block, part and channel, and chi-square with p > 0.001 (a
/// normal below 3.09). The twin, a floor that is a tenth darker, does not.
#[test]
fn derivatives_by_parts() {
    /// The floor.
    const FLOOR: usize = 0;
    let folder = tempfile::tempdir().unwrap();
    let theirs = theirs(folder.path());
    let (worst, chi_square) = compare("prb", &ours(scene()), &theirs);
    assert!(worst < 4.0 && chi_square < 3.09, "{worst} {chi_square}");

    let mut darker = scene();
    let MaterialModel::Diffuse { reflectance: ColorInput::Constant(color), .. } = &mut darker.materials[FLOOR].model
    else {
        unreachable!("the floor is diffuse")
    };
    *color = color.map(|value| 0.9 * value);
    let (worst, chi_square) = compare("twin", &ours(darker), &theirs);
    assert!(worst > 4.0 && chi_square > 3.09, "the twin passes: {worst} {chi_square}");
}
