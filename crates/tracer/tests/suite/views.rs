//! Five views from one set of paths compared with five renders, the properties of such views, and their light by
//! groups: its weighted sums equal renders of the same scene under other lights.

use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};
use mateval_dataset::reference::{Emission, ReferenceScene};
use mateval_dataset::{Camera, Intrinsics};
use mateval_image::{LinearRgb, Picture};
use mateval_testkit::scenes::{Builder, camera, grey, material, metal, quad, room, sphere};
use mateval_testkit::statistics::Renders;
use mateval_tracer::shared_centre::{groups_with_one_centre, noise_blocks};
use mateval_tracer::{LightBasis, RenderSettings, ViewsRender, World, render_views};

use super::estimators::worst;

/// A room open to a pale sky behind the camera, with three lamps, one of them hidden from the camera, and a rough metal
/// sphere. The weights multiply the radiances of the four lights.
pub fn lit_room(weights: [[f32; 3]; 4]) -> ReferenceScene {
    let mut walls = room();
    walls.truncate(5);
    let builder = walls.into_iter().fold(Builder::default(), |builder, wall| builder.surface(wall, grey(0.6)));
    let lamp = |k: usize, radiance: [f32; 3]| [0, 1, 2].map(|c| weights[k][c] * radiance[c]);
    builder
        .surface(sphere(Vec3::new(0.3, -0.5, -0.3), 0.5, 16), material(metal(Some(0.3))))
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

fn basis(world: &World, seed: u64, samples: u32) -> LightBasis {
    let settings = RenderSettings { samples, ..Default::default() };
    let mut done = render_views(world, &[view(32)], &settings, &[seed], &|_, _| ()).unwrap();
    assert_eq!(done.stats.not_finite, 0);
    done.views.remove(0).by_seed.remove(0)
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

/// With one seed, the basis comes from the same paths as that of the same room under other lights, so sums agree to
/// rounding. With a weight off by 1 % they do not.
#[test]
fn one_pass_serves_all_lightings() {
    let [plain, mixed] = [ONE, MIXED].map(|weights| basis(&lit_world(weights), 5, 8));
    let mut weights = as_f64(MIXED);
    assert!(difference(&mixed.sum(), &plain.weighted(&weights).unwrap()) < 1e-5);
    weights[2][1] *= 1.01;
    assert!(difference(&mixed.sum(), &plain.weighted(&weights).unwrap()) > 1e-3, "the twin passes");
}

/// A plain render of the room under other lights and the weighted basis of the original room have one mean, by quarters
/// and as a whole, given both variances. With other weights they differ.
#[test]
fn a_weighted_basis_is_a_render() {
    let world = lit_world(ONE);
    let bases: Vec<LightBasis> = (0..16).map(|seed| basis(&world, 90 + seed, 16)).collect();
    let weighted = |weights: &[[f64; 3]]| Renders::from_pictures(bases.iter().map(|b| b.weighted(weights).unwrap()));
    let settings = RenderSettings { samples: 16, seed: 1, ..Default::default() };
    let direct = Renders::new(&lit_world(MIXED), &view(32), settings, 16);
    let mut weights = as_f64(MIXED);
    let found = worst(&direct, &weighted(&weights));
    assert!(found < 4.5, "{found}");
    weights[1][0] *= 1.1;
    let twin = worst(&direct, &weighted(&weights));
    assert!(twin > 4.5, "the twin passes: {twin}");
}

/// A scene without lights has a basis without pictures, whose sum is black.
#[test]
fn no_lights_are_no_pictures() {
    let world = Builder::default().surface(room().remove(0), grey(0.5)).world();
    let basis = basis(&world, 1, 1);
    assert!(basis.pictures().is_empty());
    assert_eq!(basis.sum(), Picture::filled(32, 32, LinearRgb::default()));
}

const SIZE: usize = 32;
const OFFSETS: [[f64; 2]; 5] = [[0.0, 0.0], [5.0, 5.0], [5.0, -5.0], [-5.0, 5.0], [-5.0, -5.0]];

fn views() -> Vec<Camera> {
    OFFSETS.map(|[x, y]| view(SIZE as u32).turned(x, y)).to_vec()
}

fn has_one_group(cameras: &[Camera]) -> bool {
    groups_with_one_centre(cameras).len() == 1
}

fn settings(samples: u32) -> RenderSettings {
    RenderSettings { samples, max_bounces: 6, ..Default::default() }
}

fn rendered(world: &World, cameras: &[Camera], samples: u32, seeds: std::ops::Range<u64>) -> ViewsRender {
    let seeds: Vec<u64> = seeds.collect();
    let done = render_views(world, cameras, &settings(samples), &seeds, &|_, _| ()).unwrap();
    assert_eq!(done.stats.not_finite, 0);
    done
}

/// The estimates of each view, one per seed.
fn estimates(done: &ViewsRender) -> Vec<Renders> {
    let of = |view: &mateval_tracer::ViewLight| Renders::from_pictures(view.by_seed.iter().map(LightBasis::sum));
    done.views.iter().map(of).collect()
}

/// The largest distance between whole pictures in standard errors, and the mean squared distances of 8x8 tiles and of
/// pixels.
fn compare(a: &Renders, b: &Renders) -> [f64; 3] {
    let mean_square = |side: usize| {
        let places = (0..SIZE / side).flat_map(|y| (0..SIZE / side).map(move |x| (x * side, y * side)));
        let z = |(x, y): (usize, usize)| {
            let region = |r: &Renders| r.region(x..x + side, y..y + side);
            region(a).z_against(&region(b)).powi(2)
        };
        let squares: Vec<f64> = places.map(z).collect();
        squares.iter().sum::<f64>() / squares.len() as f64
    };
    [a.whole().z_against(&b.whole()).abs(), mean_square(8), mean_square(1)]
}

/// Splatted views and separate renders have one mean, for whole pictures, 8x8 tiles and pixels, given both variances. A
/// view turned by half a pixel differs, and so does one 3 % brighter.
#[test]
#[allow(clippy::print_stderr, reason = "how near it came")]
fn splatted_views_are_renders() {
    let world = lit_world([[1.0; 3]; 4]);
    let splatted = estimates(&rendered(&world, &views(), 16, 0..16));
    let separate = |world: &World, camera: &Camera, seed: u64| {
        Renders::new(world, camera, RenderSettings { seed, ..settings(16) }, 16)
    };
    // The squares of Student's t with about 30 degrees of freedom have the mean 1.07. Over 16 tiles it deviates by
    // 0.36, over 1024 pixels by 0.045.
    let agree = |[whole, tiles, pixels]: [f64; 3]| whole < 4.0 && tiles < 2.5 && pixels < 1.25;
    let renders: Vec<Renders> = views().iter().zip(50..).map(|(camera, seed)| separate(&world, camera, seed)).collect();
    for (index, renders) in renders.iter().enumerate() {
        let z = compare(&splatted[index], renders);
        eprintln!("view {index}: whole {:.2}, tiles {:.3}, pixels {:.3}", z[0], z[1], z[2]);
        assert!(agree(z), "view {index}: {z:?}");
    }
    let pixel_deg = 50.0 / SIZE as f64;
    let turned = compare(&splatted[1], &separate(&world, &views()[1].turned(0.0, 0.5 * pixel_deg), 61));
    let brighter = compare(&splatted[1], &renders[1].scaled(1.03));
    eprintln!("twins: {turned:?} {brighter:?}");
    assert!(!agree(turned) && !agree(brighter), "a twin passes: {turned:?} {brighter:?}");
}

/// The variance of one estimate for every pixel and channel, from independent estimates.
pub fn variances(renders: &Renders) -> Vec<f64> {
    let n = renders.pictures().len() as f64;
    let of = |place: usize, channel: usize| {
        let values = renders.pictures().iter().map(|p| f64::from(p.pixels()[place].0[channel]));
        let mean = values.clone().sum::<f64>() / n;
        values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0)
    };
    (0..SIZE * SIZE).flat_map(|place| (0..3).map(move |channel| of(place, channel))).collect()
}

/// The noise of `found` relative to that of `own`, where the room is visible and where a lamp or the sky is.
fn noise_ratios(found: &Renders, own: &Renders) -> [f64; 2] {
    let mean = own.picture();
    let lamp = |place: usize| mean.pixels()[place / 3].0.iter().any(|&v| v > 1.0);
    let (found, own) = (variances(found), variances(own));
    [false, true].map(|wanted| {
        let sum = |variances: &[f64]| -> f64 {
            variances.iter().enumerate().filter(|(place, _)| lamp(*place) == wanted).map(|(_, v)| v).sum()
        };
        sum(&found) / sum(&own)
    })
}

/// The noise of a splatted view relative to its own render with as many samples per pixel. In this smooth room, where
/// stratified samples gain most, it is 1.4 times as large where a view's pixels do not match the plane's, and 0.9 where
/// they do. A visible lamp shows the varying number of paths per pixel, which is exact in a render: 2.5 times. With a
/// quarter of the samples the noise is out of bounds.
#[test]
#[allow(clippy::print_stderr, reason = "a measurement")]
fn splatting_adds_little_noise() {
    let world = lit_world([[1.0; 3]; 4]);
    let splatted = |samples: u32| estimates(&rendered(&world, &views(), samples, 0..12));
    let (together, fewer) = (splatted(64), splatted(16));
    for (index, bound) in [(0, 1.1), (1, 1.6)] {
        let settings = RenderSettings { seed: 9, ..settings(64) };
        let own = Renders::new(&world, &views()[index], settings, 12);
        let [room, lamps] = noise_ratios(&together[index], &own);
        eprintln!("view {index}: {room:.3} of the variance of a render, lamps and sky {lamps:.3}");
        assert!(room < bound && lamps < 3.5, "view {index}: {room} {lamps}");
        assert!(noise_ratios(&fewer[index], &own)[0] > 2.0 * bound, "the twin passes");
    }
}

/// The same in a furnished room with textures, where paths themselves are noisy: 1.15 times, without lamps.
#[test]
#[allow(clippy::print_stderr, reason = "a measurement")]
fn splatting_adds_little_noise_to_a_furnished_room() {
    let Some(folder) = mateval_testkit::bench_scene::folder("room") else { return };
    let (scene, input) = mateval_testkit::bench_scene::read(&folder, SIZE as u32);
    let world = World::new(Arc::new(scene)).unwrap();
    let cameras = OFFSETS.map(|[x, y]| input.turned(x, y));
    let together = estimates(&rendered(&world, &cameras, 16, 0..12));
    for index in [0, 2] {
        let settings = RenderSettings { seed: 9, ..settings(16) };
        let own = Renders::new(&world, &cameras[index], settings, 12);
        let [room, lamps] = noise_ratios(&together[index], &own);
        eprintln!("view {index}: {room:.3} of the variance of a render, lamps {lamps:.3}");
        assert!(room < 1.4, "view {index}: {room}");
    }
}

/// Under an even sky radiance is constant, and all noise comes from the number of paths per pixel. Its variance is far
/// below that of random points (which equals the number) and grows as that of Sobol points.
#[test]
#[allow(clippy::print_stderr, reason = "a measurement")]
fn the_number_of_paths_a_pixel_varies_little() {
    let world = mateval_testkit::scenes::Builder::default().light(Emission::Constant { radiance: [1.0; 3] }).world();
    for (samples, bound) in [(16, 1.5), (64, 2.5)] {
        let [own, turned] = [0, 1].map(|index| {
            let all = variances(&estimates(&rendered(&world, &views(), samples, 0..12))[index]);
            all.iter().sum::<f64>() / all.len() as f64 * f64::from(samples * samples)
        });
        eprintln!("{samples} samples: the number's variance is {own:.3} in the first view, {turned:.3} in another");
        assert!(own < 1e-8 && turned < bound && turned > 0.1, "{own} {turned}");
    }
}

/// The errors of two seeds are uncorrelated in every view; those of one seed with itself are not.
#[test]
fn halves_are_independent() {
    let world = lit_world([[1.0; 3]; 4]);
    let done = rendered(&world, &views(), 2, 0..40);
    for view in &estimates(&done) {
        let (mean, variances) = (view.picture(), variances(view));
        let error = |seed: usize, place: usize| {
            let value = view.pictures()[seed].pixels()[place].0[1] - mean.pixels()[place].0[1];
            f64::from(value) / variances[3 * place + 1].sqrt()
        };
        let correlation = |second: &dyn Fn(usize) -> usize| {
            // A pixel of even sky has only rounding as noise.
            let noisy = (0..SIZE * SIZE).filter(|place| variances[3 * place + 1] > 1e-9);
            let pairs = noisy.flat_map(|place| (0..20).map(move |pair| (place, pair)));
            let sums = pairs.fold([0.0; 3], |[ab, aa, bb], (place, pair)| {
                let (a, b) = (error(2 * pair, place), error(second(pair), place));
                [ab + a * b, aa + a * a, bb + b * b]
            });
            sums[0] / (sums[1] * sums[2]).sqrt()
        };
        // Relative to the mean of all n, the errors of two have the correlation -1 / (n - 1).
        let found = correlation(&|pair| 2 * pair + 1) + 1.0 / 39.0;
        assert!(found.abs() < 0.03, "{found}");
        assert!(correlation(&|pair| 2 * pair) > 0.99, "the twin passes");
    }
}

/// Under an even sky a pixel is the number of its paths over the number expected, which is at least the request: every
/// pixel gets nearly what it is due. The union of the pictures, plus the surplus where the plane is stretched, costs
/// the paths of 1.73 of the five views.
#[test]
fn every_pixel_gets_its_samples() {
    let world = Builder::default().light(Emission::Constant { radiance: [1.0; 3] }).world();
    let cameras = OFFSETS.map(|[x, y]| camera([0.1, 0.1, 1.6], [0.0; 3], 48, 70.0).turned(x, y));
    assert!(has_one_group(&cameras));
    let done = rendered(&world, &cameras, 64, 3..4);
    for (index, view) in done.views.iter().enumerate() {
        let picture = view.by_seed[0].sum();
        let shares = picture.pixels().iter().map(|pixel| f64::from(pixel.0[0]));
        let (low, high) = shares.clone().fold((f64::MAX, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        let mean = shares.sum::<f64>() / (48.0 * 48.0);
        assert!(low > 0.8 && high < 1.2 && (mean - 1.0).abs() < 1e-3, "view {index}: {low} {mean} {high}");
    }
    let share = done.stats.paths as f64 / (48.0 * 48.0 * 64.0);
    assert!(share > 1.2 && share < 1.8, "{share}");
}

#[test]
fn a_half_depends_on_its_own_seed() {
    let world = lit_world([[1.0; 3]; 4]);
    let halves = |seeds: &[u64]| {
        let mut views = render_views(&world, &views(), &settings(3), seeds, &|_, _| ()).unwrap().views;
        views.swap_remove(0).by_seed
    };
    let (one, other) = (halves(&[4, 5]), halves(&[4, 6]));
    assert_eq!(one[0], other[0]);
    assert_ne!(one[1], other[1]);
}

/// Cameras at different points, or looking in very different directions, get a pass each, with the same pixels as
/// alone.
#[test]
fn other_view_sets_fall_back_to_one_pass_a_view() {
    let world = lit_world([[1.0; 3]; 4]);
    let first = view(SIZE as u32);
    let moved = Camera::from_rotation(first.rotation(), first.position() + DVec3::X * 1e-3, first.intrinsics);
    let back = first.turned(0.0, 120.0);
    let rounded = Camera::from_rotation(first.rotation(), first.position() + DVec3::X * 1e-9, first.intrinsics);
    assert!(has_one_group(&[first, rounded]) && has_one_group(&views()));
    for other in [moved, back] {
        assert!(!has_one_group(&[first, other]));
        let pair = rendered(&world, &[first, other], 2, 0..2);
        for (index, camera) in [first, other].iter().enumerate() {
            let alone = rendered(&world, &[*camera], 2, 0..2);
            assert_eq!(pair.views[index], alone.views[0]);
        }
    }
}

/// Views that share a centre keep their pixels when one from elsewhere is rendered with them.
#[test]
fn a_view_from_elsewhere_changes_no_other() {
    let world = lit_world([[1.0; 3]; 4]);
    let first = view(SIZE as u32);
    let moved = Camera::from_rotation(first.rotation(), first.position() + DVec3::X * 0.3, first.intrinsics);
    let mut with = views();
    with.insert(2, moved);
    assert_eq!(groups_with_one_centre(&with), [vec![0, 1, 3, 4, 5], vec![2]]);
    let (alone, with) = (rendered(&world, &views(), 2, 0..2), rendered(&world, &with, 2, 0..2));
    let others = with.views.iter().enumerate().filter(|(at, _)| *at != 2).map(|(_, view)| view);
    assert!(alone.views.iter().eq(others));
}

/// Views of other sizes and focal lengths share the paths too.
#[test]
fn views_may_differ_in_size() {
    let world = lit_world([[1.0; 3]; 4]);
    let fine = Camera { intrinsics: Intrinsics::from_fov_x(48, 40, 0.5), ..view(SIZE as u32).turned(2.0, 9.0) };
    let cameras = [view(SIZE as u32), fine];
    assert!(has_one_group(&cameras));
    let done = rendered(&world, &cameras, 8, 0..8);
    let picture = done.views[1].by_seed[0].sum();
    assert_eq!((picture.width(), picture.height()), (48, 40));
    let separate = Renders::new(&world, &fine, RenderSettings { seed: 7, ..settings(8) }, 8);
    let z = estimates(&done)[1].whole().z_against(&separate.whole());
    assert!(z.abs() < 4.0, "{z}");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let world = lit_world([[1.0; 3]; 4]);
    let message = |samples: u32, seeds: &[u64]| {
        render_views(&world, &views(), &settings(samples), seeds, &|_, _| ()).unwrap_err().to_string()
    };
    assert!(message(1, &[3, 4, 3]).contains("seed 3 occurs twice"));
    assert!(message(0, &[3]).contains("0 samples"));
}

/// With few pixels and large angles between views, tiles extend behind views. Under uniform light from everywhere,
/// every pixel is one.
#[test]
fn small_pictures_lose_nothing() {
    let world = Builder::default().light(Emission::Constant { radiance: [1.0; 3] }).world();
    let intrinsics = Intrinsics::from_fov_x(8, 8, 90.0_f64.to_radians());
    let first = Camera { intrinsics, ..view(8) };
    let cameras = [first, first.turned(22.0, 0.0), first.turned(-22.0, 0.0)];
    assert!(has_one_group(&cameras));
    let done = render_views(&world, &cameras, &settings(16), &[1], &|_, _| ()).unwrap();
    for view in &done.views {
        for pixel in view.by_seed[0].sum().pixels() {
            assert!((pixel.0[0] - 1.0).abs() < 0.3, "{pixel:?}");
        }
    }
}

fn turned_cameras() -> Vec<Camera> {
    let intrinsics = Intrinsics::from_fov_x(96, 64, 1.0);
    let input = Camera::from_rotation(glam::DMat3::IDENTITY, DVec3::new(1.0, 2.0, 3.0), intrinsics);
    vec![input, input.turned(5.0, -5.0)]
}

/// What both views see, at a distance, is of one block in both; the first view's blocks are squares.
#[test]
fn one_direction_is_of_one_block() {
    let cameras = turned_cameras();
    let blocks = noise_blocks(&cameras, 16);
    assert_eq!(blocks[0].get(0, 0), blocks[0].get(15, 15));
    assert_ne!(blocks[0].get(15, 0), blocks[0].get(16, 0));
    let mut distinct = blocks[0].pixels().to_vec();
    distinct.sort_unstable();
    distinct.dedup();
    assert_eq!(distinct.len(), 6 * 4);
    let mut met = 0;
    for (x, y) in [(50, 30), (70, 40), (90, 50), (40, 20)] {
        let place = cameras[1].position() + cameras[1].direction(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) * 9.0;
        let (pixel, _) = cameras[0].project(place).unwrap();
        if cameras[0].holds(pixel) {
            met += 1;
            assert_eq!(blocks[1].get(x, y), blocks[0].get(pixel.x as usize, pixel.y as usize));
        }
    }
    assert!(met >= 2, "{met}");
}

#[test]
fn views_from_elsewhere_share_nothing() {
    let mut cameras = turned_cameras();
    cameras[1] = Camera::from_rotation(glam::DMat3::IDENTITY, DVec3::ZERO, cameras[1].intrinsics);
    let blocks = noise_blocks(&cameras, 16);
    assert!(blocks[0].pixels().iter().all(|block| !blocks[1].pixels().contains(block)));
}
