//! Agreement between estimators of the same picture, scenes that are refused, and the bytes of pictures: they are the
//! same for any number of threads, with either instruction set, in every build and on every machine.
//!
//! `tools/test_builds.sh`, run by hand, tests that the optimised build renders these bytes too.

use std::sync::Arc;

use glam::Vec3;
use mateval_dataset::material::{
    ColorInput, Distribution, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput, TextureIndex,
};
use mateval_dataset::reference::{Emission, ReferenceScene, SourceTexture, SurfaceIndex};
use mateval_dataset::{Camera, TriangleMesh};
use mateval_image::{LinearRgb, Picture, Texels, Texture, Wrap};
use mateval_testkit::scenes::{Builder, camera, grey, material, metal, principled, quad, room, sphere};
use mateval_testkit::statistics::{Renders, counts_z};
use mateval_tracer::{Accel, LightBasis, LightSampling, Ray, RenderSettings, Sampler, World, render, render_views};
use sha2::{Digest, Sha256};

/// A room open to an environment map on one side, with a lamp, a large metal sphere, a rough plastic box and a frosted
/// pane.
pub fn scene(brightness: f32) -> ReferenceScene {
    let mut walls = room();
    walls.truncate(5);
    let facets = Some(Microfacets { distribution: Distribution::Ggx, alpha: ScalarInput::Constant(0.2) });
    let plastic = MaterialModel::Plastic {
        eta: 1.5,
        nonlinear: true,
        diffuse_reflectance: ColorInput::Constant([0.2, 0.5, 0.6]),
        specular_reflectance: ColorInput::Constant([1.0; 3]),
        microfacets: facets,
    };
    let frosted = MaterialModel::Dielectric {
        eta: 1.5,
        specular_reflectance: ColorInput::Constant([1.0; 3]),
        specular_transmittance: ColorInput::Constant([1.0; 3]),
        microfacets: facets,
    };
    let glossy = |roughness, metallic, flavour| material(principled([0.7, 0.5, 0.3], roughness, metallic, flavour));
    let mut builder = Builder::default();
    for (index, wall) in walls.into_iter().enumerate() {
        builder = match index {
            0 => builder.surface(wall, glossy(0.4, 0.0, PrincipledFlavour::Blender)),
            2 => builder.surface(wall, material(plastic)),
            _ => builder.surface(wall, grey(0.6)),
        };
    }
    let scene = builder
        .surface(sphere(Vec3::new(0.3, -0.5, -0.3), 0.5, 16), material(metal(Some(0.2))))
        .surface(sphere(Vec3::new(-0.5, -0.7, 0.2), 0.25, 12), glossy(0.3, 1.0, PrincipledFlavour::Mitsuba))
        .surface(quad(Vec3::new(-0.9, -0.4, 0.3), Vec3::X * 0.6, Vec3::Y * 0.8), material(frosted))
        .surface(quad(Vec3::new(-0.4, 0.95, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8), grey(0.0))
        .glowing([4.0 * brightness; 3])
        .scene();
    under_sky(scene, brightness)
}

/// A scene without textures under a map with a bright spot.
pub fn under_sky(mut scene: ReferenceScene, scale: f32) -> ReferenceScene {
    let texels = (0..16 * 8).map(|k| if k == 60 { [20.0; 3] } else { [0.3; 3] }).collect();
    let texture = Texture::new(16, 8, Texels::Linear(texels), Wrap::Repeat).unwrap();
    scene.textures.push(SourceTexture { name: String::new(), sha256: None, texture });
    let world_from_environment = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    Builder::from(scene)
        .light(Emission::Environment { texture: TextureIndex(0), scale, world_from_environment })
        .scene()
}

pub fn view() -> Camera {
    camera([0.2, 0.1, 2.6], [0.0, -0.1, 0.0], 32, 50.0)
}

/// The largest distance between two sets of renders in standard errors, of whole pictures and of quarters.
pub fn worst(a: &Renders, b: &Renders) -> f64 {
    let quarter = |k: usize| (16 * (k % 2)..16 * (k % 2) + 16, 16 * (k / 2)..16 * (k / 2) + 16);
    let regions = (0..4).map(quarter).chain([(0..32, 0..32)]);
    regions.map(|(x, y)| a.region(x.clone(), y.clone()).z_against(&b.region(x, y)).abs()).fold(0.0, f64::max)
}

/// Sampling emitters, the BSDF or both, with or without roulette, gives one mean. With 3 % more light the mean differs.
#[test]
fn ways_of_sampling_agree() {
    let world = World::new(Arc::new(scene(1.0))).unwrap();
    let settings = |samples, light_sampling, seed| RenderSettings {
        samples,
        light_sampling,
        seed,
        max_bounces: 6,
        ..Default::default()
    };
    let both = Renders::new(&world, &view(), settings(64, LightSampling::Both, 1), 16);
    let emitters = Renders::new(&world, &view(), settings(64, LightSampling::Emitters, 2), 16);
    let surfaces = Renders::new(&world, &view(), settings(256, LightSampling::Bsdf, 3), 16);
    let unending = RenderSettings { roulette_start: 99, ..settings(64, LightSampling::Both, 4) };
    let unending = Renders::new(&world, &view(), unending, 16);
    if let Some(out) = std::env::var_os("MATEVAL_TEST_PICTURES") {
        let path = std::path::Path::new(&out).join("estimators.png");
        mateval_image::png_io::write_srgb(&path, &both.picture().to_srgb()).unwrap();
    }
    for (name, other) in [("emitters", &emitters), ("surfaces", &surfaces), ("no roulette", &unending)] {
        let z = worst(&both, other);
        assert!(z < 4.5, "{name}: {z}, {:?} {:?}", both.whole(), other.whole());
    }
    let z = worst(&both, &unending.scaled(1.03));
    assert!(z > 4.5, "the twin passes: {z}");
}

/// Sampled directions to lights follow the density reported for them. The density of a direction is the sum over all
/// emitters on a ray along it, integrated over cells of the sphere and compared with 40,000 samples by Pearson's
/// chi-square, also where the lamps' groups have other shares. The twins: the density for a point 10 cm away, and that
/// of other shares.
#[test]
fn directions_to_lights_follow_their_density() {
    // Only lamps and the map, so that nothing blocks light.
    let lamps = [
        quad(Vec3::new(-0.4, 0.95, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8),
        quad(Vec3::new(-0.9, -0.2, -0.9), Vec3::Y * 0.5, Vec3::Z * 0.7),
        sphere(Vec3::new(0.6, -0.6, 0.3), 0.2, 10),
    ];
    let mut builder = Builder::default();
    for lamp in lamps {
        builder = builder.surface(lamp, grey(0.0)).glowing([1.0; 3]);
    }
    let world = World::new(Arc::new(under_sky(builder.scene(), 1.0))).unwrap();
    let from = Vec3::new(0.1, 0.05, 0.2);
    let shared = world.with_group_shares(&view(), &[0.2, 5.0, 1.0, 1.0]);
    let [expected, elsewhere] = [from, from + Vec3::X * 0.1].map(|place| light_density(&world, place));
    let expected_shared = light_density(&shared, from);
    // The remaining probability falls on the backs of lamps.
    let total: f64 = expected.iter().sum();
    assert!((0.7..1.0).contains(&total), "{total}");
    let z = |world: &World, expected: &[f64]| chi_square_of_lights(world, from, expected);
    for (world, expected) in [(&world, &expected), (&shared, &expected_shared)] {
        let z = z(world, expected);
        assert!(z < 5.0, "{z}");
    }
    for (world, expected) in [(&world, &elsewhere), (&shared, &expected)] {
        let z = z(world, expected);
        assert!(z > 5.0, "the twin passes: {z}");
    }
}

const ROWS: usize = 12;
const COLUMNS: usize = 24;

/// The density of directions to lights from a point, over cells of equal solid angle. A sphere's back, behind its own
/// front, and lights behind one another add up.
fn light_density(world: &World, from: Vec3) -> Vec<f64> {
    const FINE: usize = 48;
    let mut cells = vec![0.0; ROWS * COLUMNS];
    let solid_angle = 4.0 * std::f64::consts::PI / (ROWS * COLUMNS * FINE * FINE) as f64;
    for row in 0..ROWS * FINE {
        let z = (row as f32 + 0.5) / (ROWS * FINE) as f32 * 2.0 - 1.0;
        for column in 0..COLUMNS * FINE {
            let phi = (column as f32 + 0.5) / (COLUMNS * FINE) as f32 * std::f32::consts::TAU;
            let (sin, cos) = libm::sincosf(phi);
            let direction = Vec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z;
            let mut density: f32 = world.emitters().from_outside(direction).map(|found| found.density).sum();
            let mut ray = Ray::endless(from, direction);
            while let Some(hit) = world.accel().closest(&ray) {
                let place = world.surface_hit(&hit);
                density += world.emitters().emitted(&place, from).map_or(0.0, |found| found.density);
                ray = place.spawn(direction);
            }
            cells[row / FINE * COLUMNS + column / FINE] += f64::from(density) * solid_angle;
        }
    }
    cells
}

/// The deviation of light samples from `expected`, as a standard normal. Samples of the backs of lamps find nothing.
fn chi_square_of_lights(world: &World, from: Vec3, expected: &[f64]) -> f64 {
    const COUNT: u32 = 40_000;
    let mut found = vec![0.0_f64; ROWS * COLUMNS];
    for index in 0..COUNT {
        // Each sample uses another pixel, so that the numbers are independent.
        let [a, b, c, _] = Sampler::new(9, [index, 0], 0).set(0);
        let Some(sample) = world.emitters().sample(from, [a, b, c], |_| 1.0) else { continue };
        let d = sample.direction;
        let turn = libm::atan2f(d.y, d.x) / std::f32::consts::TAU;
        let column = ((turn.rem_euclid(1.0) * COLUMNS as f32) as usize).min(COLUMNS - 1);
        let row = (((d.z + 1.0) * 0.5 * ROWS as f32) as usize).min(ROWS - 1);
        found[row * COLUMNS + column] += 1.0;
    }
    counts_z(&found, expected, COUNT)
}

#[test]
fn progress_reaches_its_end() {
    let world = Builder::default().world();
    let seen = std::sync::Mutex::new(Vec::new());
    let report = |done, total| seen.lock().unwrap().push((done, total));
    render(&world, &view(), &RenderSettings { samples: 1, ..Default::default() }, &report).unwrap();
    let mut seen = seen.into_inner().unwrap();
    seen.sort_unstable();
    assert_eq!(seen, [(1, 4), (2, 4), (3, 4), (4, 4)]);
}

/// A world of other materials and uvs over the same triangles shares the hierarchy; other triangles are refused.
#[test]
fn worlds_share_a_hierarchy() {
    let first = World::new(Arc::new(scene(1.0))).unwrap();
    let mut changed = scene(1.0);
    changed.surfaces[1].material = changed.surfaces[2].material;
    let second = World::sharing(Arc::new(changed.clone()), first.accel().clone()).unwrap();
    let settings = RenderSettings { samples: 1, ..Default::default() };
    let picture = |world: &World| render(world, &view(), &settings, &|_, _| ()).unwrap().picture;
    assert_eq!(picture(&second), picture(&World::new(Arc::new(changed.clone())).unwrap()));
    assert_ne!(picture(&first), picture(&second));
    changed.surfaces[0].mesh.positions[0].x += 0.5;
    assert!(World::sharing(Arc::new(changed), first.accel().clone()).is_err());
}

#[test]
fn what_the_cap_cut_is_reported() {
    let world = World::new(Arc::new(scene(1.0))).unwrap();
    let stats = |max_bounces| {
        let settings = RenderSettings { samples: 8, max_bounces, ..Default::default() };
        render(&world, &view(), &settings, &|_, _| ()).unwrap().stats
    };
    let (short, long) = (stats(1), stats(16));
    assert!(short.capped_share > 0.2 && short.capped_throughput > 0.05, "{short:?}");
    assert!(long.capped_share < 0.05 && long.capped_throughput < 0.01, "{long:?}");
    assert_eq!((long.paths, long.not_finite), (32 * 32 * 8, 0));
}

/// Every kind of contradictory scene is refused, with a message that names the place.
#[test]
fn bad_scenes_are_refused() {
    let refused = |change: fn(&mut ReferenceScene), place: &str| {
        let mut scene = scene(1.0);
        change(&mut scene);
        let error = World::new(Arc::new(scene)).unwrap_err().to_string();
        assert!(error.contains(place), "{error}");
    };
    refused(|s| s.surfaces[1].material.0 = 99, "surface 1");
    refused(|s| s.surfaces[2].mesh.uvs = Some(vec![]), "surface 2");
    refused(|s| s.surfaces[2].mesh.normals = Some(vec![Vec3::NAN; 4]), "surface 2");
    refused(|s| s.surfaces[1].mesh.positions[2] = Vec3::INFINITY, "invalid scene: surface 1: vertex 2");
    refused(|s| s.surfaces[2].mesh.positions[3].y = f32::NAN, "surface 2: vertex 3");
    refused(|s| s.surfaces[3].mesh = TriangleMesh { triangles: vec![[7, 0, 1]], ..Default::default() }, "surface 3");
    refused(|s| s.lights[0].emission = Emission::Constant { radiance: [f32::NAN; 3] }, "light 0");
    refused(|s| s.lights.push(s.lights[0].clone()), "light 2");
    refused(
        |s| {
            let surfaces = vec![SurfaceIndex(99)];
            s.lights[0].emission = Emission::Area { surfaces, radiance: [1.0; 3], map: None, two_sided: false };
        },
        "light 0",
    );
    refused(
        |s| {
            let Emission::Environment { scale, .. } = &mut s.lights[1].emission else { unreachable!() };
            *scale = -1.0;
        },
        "light 1",
    );
    let dangling = ColorInput::Texture { texture: TextureIndex(5), uv: Default::default() };
    let mut bad = scene(1.0);
    bad.materials[1].model = MaterialModel::Diffuse { reflectance: dangling, alpha: None };
    assert!(World::new(Arc::new(bad)).unwrap_err().to_string().contains("material 1"));
}

/// A lamp without triangles emits nothing and blocks nothing.
#[test]
fn lamps_without_triangles_are_dark() {
    let mut with = scene(1.0);
    with.surfaces.push(with.surfaces[0].clone());
    let last = with.surfaces.len() - 1;
    with.surfaces[last].mesh = TriangleMesh::default();
    let mut light = with.lights[0].clone();
    light.emission =
        Emission::Area { surfaces: vec![SurfaceIndex(last)], radiance: [1.0; 3], map: None, two_sided: false };
    with.lights.push(light);
    let settings = RenderSettings { samples: 2, ..Default::default() };
    let picture =
        |scene| render(&World::new(Arc::new(scene)).unwrap(), &view(), &settings, &|_, _| ()).unwrap().picture;
    assert_eq!(picture(with), picture(scene(1.0)));
}

/// Hashes of a picture with every kind of material and light, and of two views of it from one set of paths, per light.
/// They change with anything that pictures depend on. The pictures of a release then change too, and the change must be
/// announced.
const RENDER: &str = "7030fec4b6f69e72023caa36de744f290dafebb940d31bfa7ebafa8cc30e1a8e";
const VIEWS: &str = "ab22777263eb0106adc1bb49d0ff691a4030cc52042ca3871fca25575d90e58f";

fn hash<'a>(pictures: impl IntoIterator<Item = &'a Picture<LinearRgb>>) -> String {
    let mut hasher = Sha256::new();
    for value in pictures.into_iter().flat_map(|picture| picture.pixels()).flat_map(|pixel| pixel.0) {
        hasher.update(value.to_le_bytes());
    }
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Both hashes of a world, rendered by `threads` threads.
fn hashes(world: &World, threads: usize) -> [String; 2] {
    let settings = RenderSettings { samples: 4, seed: 3, ..Default::default() };
    let views = [view(), view().turned(5.0, -5.0)];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let (picture, views) = pool.install(|| {
        let picture = render(world, &views[0], &settings, &|_, _| ()).unwrap().picture;
        (picture, render_views(world, &views, &settings, &[4, 5], &|_, _| ()).unwrap().views)
    });
    let halves = views.iter().flat_map(|view| &view.by_seed);
    [hash([&picture]), hash(halves.flat_map(LightBasis::pictures))]
}

/// With this machine's fastest instructions and with portable ones.
#[test]
fn pictures_are_those_stored() {
    let scene = Arc::new(scene(1.0));
    let meshes: Vec<&TriangleMesh> = scene.surfaces.iter().map(|surface| &surface.mesh).collect();
    let accel = Arc::new(Accel::build(&meshes).unwrap().portable());
    let portable = World::sharing(scene.clone(), accel).unwrap();
    for (threads, world) in [(1, &portable), (2, &World::new(scene.clone()).unwrap()), (7, &portable)] {
        assert_eq!(hashes(world, threads), [RENDER, VIEWS], "{threads} threads");
    }
}

/// Another seed, or a light brighter by a millionth, gives another picture.
#[test]
fn what_changes_a_picture_changes_its_hash() {
    let picture = |brightness, seed| {
        let world = World::new(Arc::new(scene(brightness))).unwrap();
        let settings = RenderSettings { samples: 4, seed, ..Default::default() };
        hash([&render(&world, &view(), &settings, &|_, _| ()).unwrap().picture])
    };
    assert_ne!(picture(1.0, 3), picture(1.0, 4));
    assert_ne!(picture(1.0, 3), picture(1.000_001, 3));
}
