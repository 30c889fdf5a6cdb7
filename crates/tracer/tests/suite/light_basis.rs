//! Tests of the light basis: its weighted sums equal renders of the same scene under other lights.

use std::sync::Arc;

use glam::Vec3;
use mateval_image::{LinearRgb, Picture};
use mateval_scene::Camera;
use mateval_scene::material::{ColorInput, ConductorIor, Distribution, MaterialModel, Microfacets, ScalarInput};
use mateval_scene::reference::{Emission, LightIndex, ReferenceScene};
use mateval_tracer::{LightBasis, LightGroups, RenderSettings, World, render_views};

use mateval_testkit::scenes::{Builder, camera, grey, material, quad, room, sphere};
use mateval_testkit::statistics::Renders;

/// A room open to a pale sky behind the camera, with three lamps, one of them hidden from the camera, and a rough metal
/// sphere. The weights multiply the radiances of the four lights.
pub fn lit_room(weights: [[f32; 3]; 4]) -> ReferenceScene {
    let mut walls = room();
    walls.truncate(5);
    let facets = Some(Microfacets { distribution: Distribution::Ggx, alpha: ScalarInput::Constant(0.3) });
    let metal = MaterialModel::Conductor {
        ior: ConductorIor::EtaK { eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.1] },
        specular_reflectance: ColorInput::Constant([1.0; 3]),
        microfacets: facets,
    };
    let builder = walls.into_iter().fold(Builder::default(), |builder, wall| builder.surface(wall, grey(0.6)));
    let lamp = |k: usize, radiance: [f32; 3]| [0, 1, 2].map(|c| weights[k][c] * radiance[c]);
    builder
        .surface(sphere(Vec3::new(0.3, -0.5, -0.3), 0.5, 16), material(metal))
        .surface(quad(Vec3::new(-0.8, 0.9, -0.8), Vec3::X * 0.4, Vec3::Z * 0.4), grey(0.3))
        .glowing(lamp(0, [6.0, 5.0, 4.0]))
        .surface(quad(Vec3::new(0.4, 0.9, -0.2), Vec3::X * 0.5, Vec3::Z * 0.5), grey(0.3))
        .glowing(lamp(1, [4.0, 4.0, 5.0]))
        .hidden()
        .surface(quad(Vec3::new(-0.95, -0.9, 0.0), Vec3::Y * 0.3, Vec3::Z * 0.3), grey(0.0))
        .glowing(lamp(2, [0.5, 3.0, 0.5]))
        .light(Emission::Constant { radiance: lamp(3, [0.3, 0.35, 0.5]) })
        .scene()
}

/// The world of [`lit_room`].
pub fn lit_world(weights: [[f32; 3]; 4]) -> World {
    World::new(Arc::new(lit_room(weights))).unwrap()
}

/// Looks into the room, with some of the darkness outside at the edges.
pub fn view(size: u32) -> Camera {
    camera([0.1, 0.1, 2.2], [0.0, -0.05, 0.0], size, 50.0)
}

const ONE: [[f32; 3]; 4] = [[1.0; 3]; 4];
const MIXED: [[f32; 3]; 4] = [[0.2, 0.5, 1.0], [3.0, 0.0, 0.7], [1.0, 2.0, 4.0], [0.0, 1.5, 0.6]];

fn basis(world: &World, groups: &LightGroups, seed: u64, samples: u32) -> LightBasis {
    let settings = RenderSettings { samples, ..Default::default() };
    let mut done = render_views(world, &[view(32)], groups, &settings, &[seed], &|_, _| ()).unwrap();
    assert_eq!(done.stats.not_finite, 0);
    done.views.remove(0).halves.remove(0).basis
}

/// The largest difference between two pictures, relative to the mean of the first.
fn difference(a: &Picture<LinearRgb>, b: &Picture<LinearRgb>) -> f64 {
    let channels = |p: &Picture<LinearRgb>| p.pixels().iter().flat_map(|v| v.0).map(f64::from).collect::<Vec<_>>();
    let (a, b) = (channels(a), channels(b));
    let mean = a.iter().sum::<f64>() / a.len() as f64;
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / mean
}

fn as_f64(weights: [[f32; 3]; 4]) -> Vec<[f64; 3]> {
    weights.map(|weight| weight.map(f64::from)).to_vec()
}

/// With one seed, the basis comes from the same paths as the picture without groups, and as that of the same room under
/// other lights, so sums agree to rounding. With a weight off by 1 % they do not.
#[test]
fn one_pass_serves_all_lightings() {
    let (plain, mixed) = (lit_world(ONE), lit_world(MIXED));
    let apart = basis(&plain, &LightGroups::apart(4), 5, 8);
    let together = |world: &World| basis(world, &LightGroups::together(4), 5, 8).sum();
    assert!(difference(&together(&plain), &apart.sum()) < 1e-5);
    let mut weights = as_f64(MIXED);
    assert!(difference(&together(&mixed), &apart.weighted(&weights).unwrap()) < 1e-5);
    weights[2][1] *= 1.01;
    assert!(difference(&together(&mixed), &apart.weighted(&weights).unwrap()) > 1e-3, "the twin passes");
}

/// A plain render of the room under other lights and the weighted basis of the original room have one mean, by quarters
/// and as a whole, given both variances. With other weights they differ.
#[test]
fn a_weighted_basis_is_a_render() {
    let world = lit_world(ONE);
    let bases: Vec<LightBasis> = (0..16).map(|seed| basis(&world, &LightGroups::apart(4), 90 + seed, 16)).collect();
    let weighted = |weights: &[[f64; 3]]| Renders::from_pictures(bases.iter().map(|b| b.weighted(weights).unwrap()));
    let settings = RenderSettings { samples: 16, seed: 1, ..Default::default() };
    let direct = Renders::new(&lit_world(MIXED), &view(32), settings, 16);
    let z = |other: &Renders| {
        let quarter = |k: usize| (16 * (k % 2)..16 * (k % 2) + 16, 16 * (k / 2)..16 * (k / 2) + 16);
        let regions = (0..4).map(quarter).chain([(0..32, 0..32)]);
        regions
            .map(|(x, y)| direct.region(x.clone(), y.clone()).z_against(&other.region(x, y)).abs())
            .fold(0.0, f64::max)
    };
    let mut weights = as_f64(MIXED);
    let found = z(&weighted(&weights));
    assert!(found < 4.5, "{found}");
    weights[1][0] *= 1.1;
    let twin = z(&weighted(&weights));
    assert!(twin > 4.5, "the twin passes: {twin}");
}

/// A group of several lights holds the sum of their pictures.
#[test]
fn merged_groups_are_sums() {
    let world = lit_world(ONE);
    let apart = basis(&world, &LightGroups::apart(4), 5, 4);
    let groups = LightGroups::within(2 * 32 * 32 * 12, 4, &[view(32)], 1).unwrap();
    assert_eq!(groups.groups(), [[LightIndex(0), LightIndex(1)], [LightIndex(2), LightIndex(3)]]);
    let merged = basis(&world, &groups, 5, 4);
    for (picture, weights) in merged.pictures().iter().zip([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]]) {
        let sum = apart.weighted(&weights.map(|w| [w; 3])).unwrap();
        assert!(difference(&sum, picture) < 1e-5);
        assert!(difference(&apart.sum(), picture) > 0.1, "the twin passes");
    }
}

/// A scene without lights has a basis without pictures, whose sum is black.
#[test]
fn no_lights_are_no_pictures() {
    let world = Builder::default().surface(room().remove(0), grey(0.5)).world();
    let basis = basis(&world, &LightGroups::apart(0), 1, 1);
    assert!(basis.pictures().is_empty());
    assert_eq!(basis.sum(), Picture::filled(32, 32, LinearRgb::default()));
}
