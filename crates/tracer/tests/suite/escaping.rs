//! The sky's share of light samples, which follows from the share of rays that leave the scene.

use std::sync::Arc;

use glam::Vec3;
use mateval_image::{Texels, Texture, Wrap};
use mateval_scene::TriangleMesh;
use mateval_scene::material::TextureIndex;
use mateval_scene::reference::{Emission, ReferenceScene, SourceTexture};
use mateval_tracer::{LightSampling, RenderSettings, World};

use super::estimators::worst;
use mateval_testkit::scenes::{Builder, camera, grey, quad, room};
use mateval_testkit::statistics::Renders;

/// Five sides of a room, and a sixth with a square window of the given side in its middle.
fn walls(window: f32) -> Vec<TriangleMesh> {
    let mut walls = room();
    walls.truncate(5);
    let rest = (2.0 - window) / 2.0;
    // Around the window: left, right, below and above it.
    for (x, y, width, height) in [
        (-1.0, -1.0, rest, 2.0),
        (1.0 - rest, -1.0, rest, 2.0),
        (-1.0 + rest, -1.0, window, rest),
        (-1.0 + rest, 1.0 - rest, window, rest),
    ] {
        if width > 0.0 && height > 0.0 {
            walls.push(quad(Vec3::new(x, y, 1.0), Vec3::Y * height, Vec3::X * width));
        }
    }
    walls
}

/// Surfaces and a lamp under the ceiling.
fn lit(surfaces: Vec<TriangleMesh>) -> ReferenceScene {
    let builder = surfaces.into_iter().fold(Builder::default(), |builder, mesh| builder.surface(mesh, grey(0.6)));
    let lamp = quad(Vec3::new(-0.3, 0.9, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6);
    builder.surface(lamp, grey(0.0)).glowing([5.0; 3]).scene()
}

/// The same under a sky: a map with a bright spot, or constant radiance.
fn under_sky(mut scene: ReferenceScene, map: bool) -> ReferenceScene {
    let sky = if map {
        let texels = (0..16 * 8).map(|k| if k == 60 { [20.0; 3] } else { [0.3; 3] }).collect();
        let texture = Texture::new(16, 8, Texels::Linear(texels), Wrap::Repeat).unwrap();
        scene.textures.push(SourceTexture { name: String::new(), sha256: None, texture });
        let world_from_environment = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Emission::Environment { texture: TextureIndex(0), scale: 1.0, world_from_environment }
    } else {
        Emission::Constant { radiance: [1.0; 3] }
    };
    scene.lights.extend(Builder::default().light(sky).scene().lights);
    scene
}

fn world(scene: ReferenceScene) -> World {
    World::new(Arc::new(scene)).unwrap()
}

/// The probability with which the sky is sampled: its density over the whole sphere.
fn share(scene: ReferenceScene) -> f32 {
    let world = world(scene);
    const COUNT: u32 = 20_000;
    let density = |k: u32| {
        let (z, phi) = ((2 * k + 1) as f32 / COUNT as f32 - 1.0, k as f32 * 2.399_963_2);
        let (sin, cos) = libm::sincosf(phi);
        let direction = Vec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z;
        world.emitters().from_outside(direction).map(|found| found.density).sum::<f32>()
    };
    (0..COUNT).map(density).sum::<f32>() * 4.0 * std::f32::consts::PI / COUNT as f32
}

/// A wider window gives the sky more samples; a closed room nearly none, an open floor as many as the lamp. Constant sky gets
/// nearly none anywhere, and all where there is no lamp.
#[test]
fn the_skys_share_grows_with_the_window() {
    let shares = [0.0, 0.3, 0.8, 2.0].map(|window| share(under_sky(lit(walls(window)), true)));
    assert!(shares[0] > 0.005 && shares[0] < 0.015, "{shares:?}");
    assert!(shares.is_sorted_by(|a, b| a < b) && shares[1] > 0.1 && shares[3] > 0.45, "{shares:?}");
    let floor = || vec![quad(Vec3::new(-1.0, -1.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0)];
    let open = share(under_sky(lit(floor()), true));
    assert!((0.45..0.55).contains(&open), "{open}");
    for surfaces in [walls(0.0), walls(2.0), floor()] {
        let constant = share(under_sky(lit(surfaces), false));
        assert!(constant > 0.005 && constant < 0.015, "{constant}");
    }
    let unlit = Builder::default().surface(floor().remove(0), grey(0.6)).scene();
    let alone = share(under_sky(unlit, false));
    assert!((alone - 1.0).abs() < 1e-3, "{alone}");
}

/// Two worlds of one scene, built on one thread and on several, sample the sky alike.
#[test]
fn the_share_does_not_depend_on_threads() {
    let scene = || under_sky(lit(walls(0.8)), true);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let many = rayon::ThreadPoolBuilder::new().num_threads(5).build().unwrap();
    assert_eq!(alone.install(|| share(scene())).to_bits(), many.install(|| share(scene())).to_bits());
}

fn renders(scene: ReferenceScene, light_sampling: LightSampling, samples: u32, seed: u64) -> Renders {
    let view = camera([0.2, 0.1, 0.95], [0.0, -0.2, -1.0], 32, 60.0);
    let settings = RenderSettings { samples, light_sampling, seed, ..Default::default() };
    Renders::new(&world(scene), &view, settings, 16)
}

/// The mean over pixels of the variance between renders.
fn variance(renders: &Renders) -> f64 {
    let pictures = renders.pictures();
    let count = pictures.len() as f64;
    let pixels = pictures[0].pixels().len();
    let of_pixel = |at: usize| {
        let values: Vec<f64> = pictures.iter().map(|picture| f64::from(picture.pixels()[at].0[1])).collect();
        let mean = values.iter().sum::<f64>() / count;
        values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (count - 1.0)
    };
    (0..pixels).map(of_pixel).sum::<f64>() / pixels as f64
}

/// A sky that no ray reaches leaves the noise of a closed room as it is. The twin: half of the samples cost it more than half
/// of its precision, as they did when every sky got them.
#[test]
fn a_sky_outside_costs_a_closed_room_nothing() {
    let plain = renders(lit(walls(0.0)), LightSampling::Both, 16, 1);
    for map in [true, false] {
        let with = renders(under_sky(lit(walls(0.0)), map), LightSampling::Both, 16, 2);
        let (ratio, z) = (variance(&with) / variance(&plain), worst(&with, &plain));
        assert!((0.85..1.15).contains(&ratio) && z < 4.5, "{ratio} {z}");
    }
    let half = renders(lit(walls(0.0)), LightSampling::Both, 8, 3);
    assert!(variance(&half) / variance(&plain) > 1.5, "the twin passes");
}

/// A lamp in a closed box lets no probe reach the sky, which lights all that the camera sees: samples of the BSDF alone have
/// the same mean.
#[test]
fn a_sky_that_no_probe_reaches_still_shines() {
    let boxed = || {
        let shrunk = |mesh: TriangleMesh| TriangleMesh {
            positions: mesh.positions.iter().map(|p| *p * 0.3 + Vec3::new(3.0, 0.0, 0.0)).collect(),
            ..mesh
        };
        let sealed = room().into_iter().map(shrunk);
        let surfaces = walls(2.0).into_iter().chain(sealed);
        let builder = surfaces.fold(Builder::default(), |builder, mesh| builder.surface(mesh, grey(0.6)));
        let lamp = quad(Vec3::new(2.9, 0.1, -0.1), Vec3::X * 0.2, Vec3::Z * 0.2);
        under_sky(builder.surface(lamp, grey(0.0)).glowing([5.0; 3]).scene(), true)
    };
    assert!(share(boxed()) < 0.015);
    let both = renders(boxed(), LightSampling::Both, 64, 4);
    let surfaces = renders(boxed(), LightSampling::Bsdf, 256, 5);
    let z = worst(&both, &surfaces);
    assert!(z < 4.5, "{z}");
    let twin = worst(&both, &surfaces.scaled(1.1));
    assert!(twin > 4.5, "the twin passes: {twin}");
}
