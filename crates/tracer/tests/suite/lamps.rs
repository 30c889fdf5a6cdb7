//! Lamps whose radiance follows a texture, and the sky's share of light samples, which follows from the share of rays
//! that leave the scene.

use std::sync::Arc;

use glam::Vec3;
use mateval_dataset::material::{ColorInput, ConductorIor, MaterialModel, TextureIndex, UvTransform};
use mateval_dataset::reference::{Emission, ReferenceScene};
use mateval_dataset::{Camera, TriangleMesh};
use mateval_image::{LinearRgb, Picture, Texels, Texture, Wrap};
use mateval_testkit::scenes::{Builder, camera, grey, material, metal, quad, room, sphere};
use mateval_testkit::statistics::Renders;
use mateval_tracer::{LightBasis, LightSampling, RenderSettings, Sampler, World, render, render_views};

use super::estimators::{self, view, worst};
use super::views::variances;

fn settings(samples: u32, seed: u64) -> RenderSettings {
    RenderSettings { samples, seed, max_bounces: 6, ..Default::default() }
}

fn picture(scene: ReferenceScene, camera: &Camera) -> Picture<LinearRgb> {
    let world = World::new(Arc::new(scene)).unwrap();
    render(&world, camera, &settings(4, 3), &|_, _| ()).unwrap().picture
}

fn texture(width: usize, texels: &[[f32; 3]]) -> Texture {
    Texture::new(width, texels.len() / width, Texels::Linear(texels.to_vec()), Wrap::Clamp).unwrap()
}

/// Two texels side by side, with a transition half way over a two-thousandth of the uv.
fn two_tone(left: [f32; 3], right: [f32; 3]) -> (Texture, UvTransform) {
    (texture(2, &[left, right]), UvTransform([[1000.0, 0.0, -499.5], [0.0, 1.0, 0.0]]))
}

fn lamp() -> TriangleMesh {
    quad(Vec3::new(-0.6, 0.9, -0.4), Vec3::X * 1.2, Vec3::Z * 0.8)
}

/// A room with a sphere, without the lamp below its ceiling.
fn furnished() -> Builder {
    let mut walls = room();
    walls.truncate(5);
    let builder = walls.into_iter().fold(Builder::default(), |builder, wall| builder.surface(wall, grey(0.6)));
    builder.surface(sphere(Vec3::new(0.3, -0.5, -0.3), 0.4, 16), material(metal(None)))
}

/// The lamp's map has many strongly differing texels, some of them black, and is repeated and skewed. The lamp reflects
/// nothing.
fn motley() -> Builder {
    let texels: Vec<[f32; 3]> =
        (0..20).map(|k| [k % 3, k % 5, k % 7].map(|v| if k % 4 == 0 { 0.0 } else { v as f32 })).collect();
    let texture = Texture::new(5, 4, Texels::Linear(texels), Wrap::Repeat).unwrap();
    let uv = UvTransform([[1.7, 0.4, -0.3], [-0.2, 1.3, 0.6]]);
    furnished().surface(lamp(), grey(0.0)).glowing([3.0, 2.5, 2.0]).mapped(texture, uv)
}

/// A map of a constant colour c times radiance r equals radiance r c exactly; one larger by a hundredth does not.
#[test]
fn a_map_of_one_colour_is_a_radiance() {
    let (radiance, colour) = ([4.0, 3.0, 2.5], [0.3, 0.7, 1.1]);
    let lit = |builder: Builder| picture(builder.scene(), &view());
    let lamp = |radiance: [f32; 3]| furnished().surface(lamp(), grey(0.2)).glowing(radiance);
    let plain = lit(lamp([0, 1, 2].map(|c| radiance[c] * colour[c])));
    let uv = UvTransform([[1.7, 0.4, -0.3], [-0.2, 1.3, 0.6]]);
    let mapped = |colour: [f32; 3]| lit(lamp(radiance).mapped(texture(2, &[colour; 4]), uv));
    assert!(plain == mapped(colour));
    assert!(plain != mapped(colour.map(|c| 1.01 * c)), "the twin passes");
    // The same for textures of bytes, the usual kind.
    let bytes = Texture::new(1, 1, Texels::Linear8(vec![[51, 102, 255]]), Wrap::Repeat).unwrap();
    let half = lit(lamp([1.0; 3]).mapped(bytes, uv));
    assert!(half == lit(lamp([51.0 / 255.0, 102.0 / 255.0, 1.0])));
}

/// A surface without uv shows a single point of the map.
#[test]
fn without_uv_one_place_is_looked_up() {
    let bare = TriangleMesh { uvs: None, ..lamp() };
    let lit = |mesh: TriangleMesh, builder: fn(Builder) -> Builder| {
        picture(builder(furnished().surface(mesh, grey(0.2)).glowing([2.0; 3])).scene(), &view())
    };
    let mapped = |builder: Builder| {
        builder.mapped(texture(2, &[[0.5; 3], [9.0; 3]]), UvTransform([[0.5, 0.0, 0.25], [0.0, 0.5, 0.5]]))
    };
    let plain = furnished().surface(bare.clone(), grey(0.2)).glowing([1.0; 3]);
    let plain = picture(plain.scene(), &view());
    assert!(lit(bare, mapped) == plain);
    assert!(lit(lamp(), mapped) != plain, "the twin passes");
}

/// A rectangle of two tones equals two rectangles of one tone each; swapping the tones makes a difference.
#[test]
fn two_tones_are_two_lamps() {
    let (left, right) = ([6.0, 1.0, 0.5], [0.5, 1.0, 4.0]);
    let half = |k: f32| quad(Vec3::new(-0.6 + 0.6 * k, 0.9, -0.4), Vec3::X * 0.6, Vec3::Z * 0.8);
    let two = |left, right| {
        furnished().surface(half(0.0), grey(0.2)).glowing(left).surface(half(1.0), grey(0.2)).glowing(right)
    };
    let (tones, uv) = two_tone(left, right);
    let one = furnished().surface(lamp(), grey(0.2)).glowing([1.0; 3]).mapped(tones, uv);
    let renders = |builder: Builder, seed| Renders::new(&builder.world(), &view(), settings(16, seed), 16);
    let one = renders(one, 1);
    let z = worst(&one, &renders(two(left, right), 2));
    assert!(z < 4.5, "{z}");
    let z = worst(&one, &renders(two(right, left), 3));
    assert!(z > 4.5, "the twin passes: {z}");
}

/// Sampling the lamp, the BSDF or both gives one mean; a lamp of constant colour gives another.
#[test]
fn ways_of_sampling_a_mapped_lamp_agree() {
    let renders = |builder: Builder, samples, light_sampling, seed| {
        let settings = RenderSettings { light_sampling, ..settings(samples, seed) };
        Renders::new(&builder.world(), &view(), settings, 16)
    };
    let both = renders(motley(), 16, LightSampling::Both, 1);
    let emitters = renders(motley(), 16, LightSampling::Emitters, 2);
    let surfaces = renders(motley(), 64, LightSampling::Bsdf, 3);
    for (name, other) in [("emitters", &emitters), ("surfaces", &surfaces)] {
        let z = worst(&both, other);
        assert!(z < 4.5, "{name}: {z}");
    }
    let plain = furnished().surface(lamp(), grey(0.0)).glowing([2.0, 3.0, 4.0]);
    let z = worst(&both, &renders(plain, 16, LightSampling::Both, 4));
    assert!(z > 4.5, "the twin passes: {z}");
}

/// Light sampling does not depend on the map: points and densities equal those without a map.
#[test]
fn a_map_steers_no_sample() {
    let [mapped, plain] =
        [motley(), furnished().surface(lamp(), grey(0.2)).glowing([3.0, 2.5, 2.0])].map(Builder::world);
    let mut colours = std::collections::BTreeSet::new();
    for index in 0..500 {
        let [a, b, c, _] = Sampler::new(9, [index, 0], 0).set(0);
        let [with, without] =
            [&mapped, &plain].map(|world| world.emitters().sample(Vec3::ZERO, [a, b, c], |_| 1.0).unwrap());
        assert_eq!((with.direction, with.density, with.place), (without.direction, without.density, without.place));
        let found = mapped.emitters().emitted(&with.place.unwrap(), Vec3::ZERO).unwrap();
        assert_eq!(found.radiance, with.radiance);
        colours.insert(with.radiance.to_array().map(f32::to_bits));
    }
    assert!(colours.len() > 100, "{}", colours.len());
}

/// The camera sees the map on the lamp; from behind it sees the map mirrored if both sides emit, otherwise nothing.
#[test]
fn both_sides_show_the_map() {
    let (left, right) = ([2.0, 0.5, 0.25], [0.5, 3.0, 1.0]);
    let sheet = quad(Vec3::new(-1.0, -1.0, -2.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    let seen = |both: bool, from: &Camera| {
        let (tones, uv) = two_tone(left, right);
        let builder = Builder::default().surface(sheet.clone(), grey(0.0)).glowing([2.0; 3]).mapped(tones, uv);
        let picture = picture(if both { builder.on_both_sides() } else { builder }.scene(), from);
        [picture.get(1, 2).0, picture.get(6, 2).0]
    };
    let (before, behind) = (camera([0.0; 3], [0.0, 0.0, -2.0], 8, 20.0), camera([0.0, 0.0, -4.0], [0.0; 3], 8, 20.0));
    let doubled = |rgb: [f32; 3]| rgb.map(|v| 2.0 * v);
    for both in [true, false] {
        assert_eq!(seen(both, &before), [doubled(left), doubled(right)]);
    }
    assert_eq!(seen(true, &behind), [doubled(right), doubled(left)]);
    assert_eq!(seen(false, &behind), [[0.0; 3]; 2]);
}

/// A lamp hidden from the camera shows it its material; a mirror still shows the map, and everything else is lit the
/// same.
#[test]
fn hidden_from_the_camera() {
    let (left, right) = ([2.0, 0.5, 0.25], [0.5, 3.0, 1.0]);
    let mirror = MaterialModel::Conductor {
        ior: ConductorIor::PerfectMirror,
        specular_reflectance: ColorInput::Constant([1.0; 3]),
        microfacets: None,
    };
    let build = || {
        let (tones, uv) = two_tone(left, right);
        Builder::default()
            .surface(quad(Vec3::new(-1.0, -1.0, 1.0), Vec3::Y * 2.0, Vec3::X * 2.0), material(mirror))
            .surface(quad(Vec3::new(-1.0, -1.0, -3.0), Vec3::X * 2.0, Vec3::Y * 2.0), grey(0.0))
            .glowing([1.0; 3])
            .mapped(tones, uv)
    };
    let at_lamp = camera([0.0; 3], [0.0, 0.0, -3.0], 8, 20.0);
    let at_mirror = camera([0.0; 3], [0.0, 0.0, 1.0], 8, 20.0);
    let seen = |builder: Builder, from: &Camera| {
        let picture = picture(builder.scene(), from);
        [picture.get(1, 2).0, picture.get(6, 2).0]
    };
    assert_eq!(seen(build().hidden(), &at_lamp), [[0.0; 3]; 2]);
    assert_eq!(seen(build(), &at_lamp), [left, right]);
    // The mirror reverses the map again, since the camera has turned too.
    assert_eq!(seen(build().hidden(), &at_mirror), [right, left]);

    let lit = |builder: Builder| picture(builder.scene(), &camera([0.0, 0.2, 0.6], [0.0, -0.8, -0.2], 16, 30.0));
    assert!(lit(motley().hidden()) == lit(motley()));
    assert!(lit(motley()) != lit(furnished()), "the twin passes");
}

/// The weighted basis from one pass equals the render of lamps with those radiances; a weight off by 1 % does not.
#[test]
fn a_weighted_basis_is_a_render() {
    let lit = |weights: [[f32; 3]; 2]| {
        let mut scene = motley().light(Emission::Constant { radiance: [0.3 * weights[1][0]; 3] }).scene();
        let Emission::Area { radiance, .. } = &mut scene.lights[0].emission else { unreachable!() };
        (0..3).for_each(|c| radiance[c] *= weights[0][c]);
        World::new(Arc::new(scene)).unwrap()
    };
    let basis = |world: &World| -> LightBasis {
        let views = [view(), view().turned(5.0, -5.0)];
        let mut done = render_views(world, &views, &settings(8, 0), &[5], &|_, _| ()).unwrap();
        done.views.remove(1).by_seed.remove(0)
    };
    let apart = basis(&lit([[1.0; 3]; 2]));
    let direct = basis(&lit([[0.2, 0.5, 3.0], [0.7; 3]])).sum();
    let difference = |weights: &[[f64; 3]]| {
        let weighted = apart.weighted(weights).unwrap();
        let channels = |p: &Picture<LinearRgb>| p.pixels().iter().flat_map(|v| v.0).collect::<Vec<f32>>();
        let pairs = channels(&weighted).into_iter().zip(channels(&direct));
        pairs.map(|(a, b)| (a - b).abs() / b.max(0.1)).fold(0.0, f32::max)
    };
    assert!(difference(&[[0.2, 0.5, 3.0], [0.7; 3]]) < 1e-5);
    assert!(difference(&[[0.2, 0.505, 3.0], [0.7; 3]]) > 1e-3, "the twin passes");
}

/// Maps that do not exist or hold values that are no radiance are refused, with the name of the light.
#[test]
fn bad_maps_are_refused() {
    let error = |texels: [f32; 3], index: usize, scale: f32| {
        let mut scene = estimators::scene(1.0);
        scene.textures.truncate(1);
        let uv = UvTransform([[scale, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let lamp = Builder::from(scene).surface(lamp(), grey(0.2)).glowing([1.0; 3]);
        let mut scene = lamp.mapped(texture(1, &[texels]), uv).scene();
        let Some(Emission::Area { map: Some(map), .. }) = scene.lights.last_mut().map(|group| &mut group.emission)
        else {
            unreachable!("it has just been given one")
        };
        map.texture = TextureIndex(index);
        World::new(Arc::new(scene)).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(error([1.0; 3], 1, 1.0), Ok(()));
    for (texels, index, scale) in [
        ([1.0; 3], 2, 1.0),
        ([1.0; 3], usize::MAX, 1.0),
        ([1.0, -0.1, 1.0], 1, 1.0),
        ([1.0, f32::NAN, 1.0], 1, 1.0),
        ([1.0; 3], 1, f32::INFINITY),
    ] {
        let error = error(texels, index, scale).unwrap_err();
        assert!(error.contains("light 2"), "{error}");
    }
}

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
fn under_sky(scene: ReferenceScene, map: bool) -> ReferenceScene {
    if map {
        return estimators::under_sky(scene, 1.0);
    }
    Builder::from(scene).light(Emission::Constant { radiance: [1.0; 3] }).scene()
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

/// A wider window gives the sky more samples; a closed room nearly none, an open floor as many as the lamp. Constant
/// sky gets nearly none anywhere, and all where there is no lamp.
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

/// The mean variance between renders of a pixel's channel.
fn variance(renders: &Renders) -> f64 {
    let variances = variances(renders);
    variances.iter().sum::<f64>() / variances.len() as f64
}

/// A sky that no ray reaches leaves the noise of a closed room as it is. The twin: half of the samples cost it more
/// than half of its precision, as they did when every sky got them.
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

/// A lamp in a closed box lets no probe reach the sky, which lights all that the camera sees: samples of the BSDF alone
/// have the same mean.
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
