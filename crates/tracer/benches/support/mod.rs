//! What benchmarks share: a generated furnished room with any number of triangles, and interleaved timing, so that
//! other load on the machine affects all contestants alike.
#![allow(dead_code, reason = "benchmarks share it, and not each uses all")]

use cpu_time::ProcessTime;
use glam::{DVec3, Vec2, Vec3};
use mateval_dataset::material::{ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput};
use mateval_dataset::reference::{Emission, LightGroup, MaterialIndex, ReferenceScene, Surface, SurfaceIndex};
use mateval_dataset::{Camera, Intrinsics, TriangleMesh};

/// A closed room of 6 x 5 x 3 m (z up) with bumpy spheres on its floor: about `triangles` triangles, one mesh per
/// sphere.
pub fn room(triangles: usize) -> Vec<TriangleMesh> {
    const BALLS: usize = 24;
    let rings = ((triangles as f32 / (4 * BALLS) as f32).sqrt().round() as u32).max(3);
    let mut meshes = vec![shell(Vec3::new(6.0, 5.0, 3.0))];
    for k in 0..BALLS {
        let [x, y, z, size] = sobol_burley::sample_4d(k as u32, 0, 11);
        let radius = 0.15 + 0.35 * size;
        let centre = Vec3::new(0.6 + 4.8 * x, 0.6 + 3.8 * y, radius + (2.6 - radius) * z * z);
        meshes.push(ball(centre, radius, rings, k as f32));
    }
    meshes
}

fn shell(size: Vec3) -> TriangleMesh {
    let corner = |k: u32| size * Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32);
    let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    TriangleMesh {
        positions: (0..8).map(corner).collect(),
        triangles: faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..Default::default()
    }
}

/// A sphere of 4 * rings^2 triangles with a wavy surface.
fn ball(centre: Vec3, radius: f32, rings: u32, phase: f32) -> TriangleMesh {
    let sectors = 2 * rings;
    let mut mesh = TriangleMesh { uvs: Some(Vec::new()), ..Default::default() };
    for ring in 0..=rings {
        for sector in 0..=sectors {
            let uv = Vec2::new(sector as f32 / sectors as f32, ring as f32 / rings as f32);
            let (sin_t, cos_t) = libm::sincosf(std::f32::consts::PI * uv.y);
            let (sin_p, cos_p) = libm::sincosf(std::f32::consts::TAU * uv.x);
            let wave = 1.0 + 0.1 * libm::sinf(9.0 * sin_t * cos_p + phase) * libm::sinf(7.0 * cos_t - phase);
            mesh.positions.push(centre + Vec3::new(sin_t * cos_p, sin_t * sin_p, cos_t) * (radius * wave));
            mesh.uvs.get_or_insert_default().push(uv);
        }
    }
    let at = |ring: u32, sector: u32| ring * (sectors + 1) + sector;
    for r in 0..rings {
        for s in 0..sectors {
            mesh.triangles.push([at(r, s), at(r + 1, s), at(r, s + 1)]);
            mesh.triangles.push([at(r + 1, s), at(r + 1, s + 1), at(r, s + 1)]);
        }
    }
    mesh
}

/// The meshes of [`room`] as a scene to render, with a lamp under the ceiling, grey walls and glossy spheres, and a
/// camera of `size` x `size` pixels.
#[allow(dead_code, reason = "one benchmark traces rays alone")]
pub fn lit(meshes: Vec<TriangleMesh>, size: u32) -> (ReferenceScene, Camera) {
    let principled = |color: f32, roughness: f32| Material {
        name: String::new(),
        model: MaterialModel::Principled {
            base_color: ColorInput::Constant([color, 0.5, 1.0 - color]),
            roughness: ScalarInput::Constant(roughness),
            metallic: ScalarInput::Constant(0.0),
            specular: 0.5,
            flavour: PrincipledFlavour::Blender,
        },
        two_sided: true,
        opacity: None,
        bump: None,
    };
    let mut scene =
        ReferenceScene { materials: vec![principled(0.5, 0.9), principled(0.7, 0.3)], ..Default::default() };
    let corners = [[2.0, 1.5], [4.0, 1.5], [4.0, 3.5], [2.0, 3.5]].map(|[x, y]| Vec3::new(x, y, 2.9));
    let lamp = TriangleMesh { positions: corners.into(), triangles: vec![[0, 2, 1], [0, 3, 2]], ..Default::default() };
    for (index, mesh) in meshes.into_iter().chain([lamp]).enumerate() {
        let material = MaterialIndex(usize::from(index > 0));
        scene.surfaces.push(Surface { name: String::new(), mesh, material });
    }
    let surfaces = vec![SurfaceIndex(scene.surfaces.len() - 1)];
    let emission = Emission::Area { surfaces, radiance: [8.0; 3], map: None, two_sided: false };
    scene.lights.push(LightGroup { name: String::new(), emission, camera_visible: true });
    (scene, camera(size))
}

/// Looks from a corner across the room.
pub fn camera(size: u32) -> Camera {
    let intrinsics = Intrinsics::from_fov_x(size, size, 1.2);
    Camera::look_at(DVec3::new(0.2, 0.2, 1.7), DVec3::new(4.0, 3.5, 0.8), DVec3::Z, intrinsics).unwrap()
}

/// A contestant: a name and a function that runs it.
pub type Contestant<'a> = (&'a str, Box<dyn FnMut() + 'a>);

/// Runs all contestants once per round, after one round to warm up, and returns the CPU seconds of every run per
/// contestant.
pub fn interleaved(rounds: usize, contestants: &mut [Contestant]) -> Vec<Vec<f64>> {
    let mut seconds = vec![Vec::new(); contestants.len()];
    for round in 0..=rounds {
        for (which, (_, run)) in contestants.iter_mut().enumerate() {
            let start = ProcessTime::now();
            run();
            let elapsed = start.elapsed().as_secs_f64();
            if round > 0 {
                seconds[which].push(elapsed);
            }
        }
    }
    seconds
}

/// The median.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// The median over rounds of the first contestant's time over the second's.
pub fn speedup(first: &[f64], second: &[f64]) -> f64 {
    median(&first.iter().zip(second).map(|(first, second)| first / second).collect::<Vec<_>>())
}
