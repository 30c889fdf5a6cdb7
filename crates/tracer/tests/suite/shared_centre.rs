//! Five views from one set of paths against five renders, and what such views promise.

use glam::DVec3;
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::Camera;
use mateval_tracer::shared_centre::share_centre;
use mateval_tracer::{LightGroups, RenderSettings, ViewsRender, World, render_views};

use super::light_basis::{lit_world, view};
use super::statistics::Renders;

const SIZE: usize = 32;
const OFFSETS: [[f64; 2]; 5] = [[0.0, 0.0], [5.0, 5.0], [5.0, -5.0], [-5.0, 5.0], [-5.0, -5.0]];

fn views() -> Vec<Camera> {
    OFFSETS.map(|[x, y]| view(SIZE as u32).turned(x, y)).to_vec()
}

fn settings(samples: u32) -> RenderSettings {
    RenderSettings { samples, max_bounces: 6, ..Default::default() }
}

fn rendered(world: &World, cameras: &[Camera], samples: u32, seeds: std::ops::Range<u64>) -> ViewsRender {
    let seeds: Vec<u64> = seeds.collect();
    let groups = LightGroups::together(world.scene().lights.len());
    let done = render_views(world, cameras, &groups, &settings(samples), &seeds, &|_, _| ()).unwrap();
    assert_eq!(done.stats.not_finite, 0);
    done
}

/// Each view's estimates, one a seed.
fn estimates(done: &ViewsRender) -> Vec<Renders> {
    let of = |view: &mateval_tracer::ViewLight| Renders::from_pictures(view.halves.iter().map(|half| half.basis.sum()));
    done.views.iter().map(of).collect()
}

/// The largest distance between whole pictures in standard errors, and mean squared distances of 8x8 tiles and of pixels.
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

/// Splatted views and separate renders have one mean, as wholes, in 8x8 tiles and pixel by pixel, by both variances; a
/// view turned by a tenth of a pixel more has not, nor has one 3 % brighter.
#[test]
#[allow(clippy::print_stderr, reason = "how near it came")]
fn splatted_views_are_renders() {
    let world = lit_world([[1.0; 3]; 4]);
    let splatted = estimates(&rendered(&world, &views(), 16, 0..16));
    let separate = |world: &World, camera: &Camera, seed: u64| {
        Renders::new(world, camera, RenderSettings { seed, ..settings(16) }, 16)
    };
    // The squares of Student's t with about 30 degrees of freedom average to 1.07; 16 tiles leave a deviation of 0.36,
    // 1024 pixels of 0.045.
    let agree = |[whole, tiles, pixels]: [f64; 3]| whole < 4.0 && tiles < 2.5 && pixels < 1.25;
    for (index, camera) in views().iter().enumerate() {
        let z = compare(&splatted[index], &separate(&world, camera, 50 + index as u64));
        eprintln!("view {index}: whole {:.2}, tiles {:.3}, pixels {:.3}", z[0], z[1], z[2]);
        assert!(agree(z), "view {index}: {z:?}");
    }
    let pixel_deg = 50.0 / SIZE as f64;
    let turned = compare(&splatted[1], &separate(&world, &views()[1].turned(0.0, 0.5 * pixel_deg), 61));
    let brighter = compare(&splatted[1], &separate(&lit_world([[1.03; 3]; 4]), &views()[1], 62));
    eprintln!("twins: {turned:?} {brighter:?}");
    assert!(!agree(turned) && !agree(brighter), "a twin passes: {turned:?} {brighter:?}");
}

/// Of every pixel, the variance of one estimate, from independent ones, channels summed.
fn variances(renders: &Renders) -> Vec<f64> {
    let n = renders.pictures().len() as f64;
    let of_channel = |place: usize, channel: usize| {
        let values = renders.pictures().iter().map(|p| f64::from(p.pixels()[place].0[channel]));
        let mean = values.clone().sum::<f64>() / n;
        values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0)
    };
    (0..SIZE * SIZE).map(|place| (0..3).map(|channel| of_channel(place, channel)).sum()).collect()
}

/// A splatted view is about as noisy as a render of its own with as many samples a pixel.
#[test]
#[allow(clippy::print_stderr, reason = "a measurement")]
fn splatting_adds_little_noise() {
    let world = lit_world([[1.0; 3]; 4]);
    for samples in [4, 16, 64] {
        let together = estimates(&rendered(&world, &views(), samples, 0..12));
        for (index, camera) in views().iter().enumerate().take(2) {
            let settings = RenderSettings { seed: 9, ..settings(samples) };
            let separate = Renders::new(&world, camera, settings, 12);
            let alone = estimates(&rendered(&world, std::slice::from_ref(camera), samples, 0..12));
            let mean = separate.picture();
            let (va, vt, vs) = (variances(&alone[0]), variances(&together[index]), variances(&separate));
            for (name, lo, hi) in [("all", 0.0, 1e9), ("dark", 0.0, 1e-9), ("room", 1e-9, 1.0), ("bright", 1.0, 1e9)] {
                let sum = |v: &[f64]| -> f64 { (0..v.len()).filter(|&i| { let m = mean.pixels()[i].0[1]; m >= lo && m < hi }).map(|i| v[i]).sum() };
                let (a, t, s) = (sum(&va), sum(&vt), sum(&vs));
                eprintln!("{samples} samples, view {index} {name}: separate {s:.4} splatted x{:.3}, alone x{:.3}", t / s, a / s);
            }
            let mut r: Vec<f64> = vt.iter().zip(&vs).filter(|(_, s)| **s > 0.0).map(|(t, s)| t / s).collect();
            r.sort_by(f64::total_cmp);
            eprintln!("   median ratio {:.3}, p10 {:.3} p90 {:.3}", r[r.len()/2], r[r.len()/10], r[r.len()*9/10]);
        }
    }
}

/// Errors of two seeds are uncorrelated in every view.
#[test]
fn halves_are_independent() {
    let world = lit_world([[1.0; 3]; 4]);
    let done = rendered(&world, &views(), 2, 0..40);
    for view in &estimates(&done) {
        let mean = view.picture();
        // Against the mean of all n, errors of two of them have the correlation -1 / (n - 1).
        let error = |seed: usize, place: usize, channel: usize| {
            f64::from(view.pictures()[seed].pixels()[place].0[channel] - mean.pixels()[place].0[channel])
        };
        let correlation = |pairs: &dyn Fn(usize) -> [usize; 2]| {
            let mut sums = [0.0; 3];
            for (place, pair) in (0..SIZE * SIZE).flat_map(|place| (0..20).map(move |pair| (place, pair))) {
                let [a, b] = pairs(pair).map(|seed| error(seed, place, 1));
                sums = [sums[0] + a * b, sums[1] + a * a, sums[2] + b * b];
            }
            sums[0] / (sums[1] * sums[2]).sqrt()
        };
        let found = correlation(&|pair| [2 * pair, 2 * pair + 1]);
        assert!((found + 1.0 / 39.0).abs() < 0.03, "{found}");
        assert!(correlation(&|pair| [pair, pair]) > 0.99, "the twin passes");
    }
}

/// Every pixel gets about the samples asked for, none less than 8/10 of them, and the mean is above what was asked.
#[test]
fn every_pixel_gets_its_samples() {
    let world = lit_world([[1.0; 3]; 4]);
    let wide =
        |offset: [f64; 2]| super::scenes::camera([0.1, 0.1, 2.2], [0.0; 3], 48, 70.0).turned(offset[0], offset[1]);
    let done = rendered(&world, &OFFSETS.map(wide), 64, 3..4);
    assert_eq!(done.passes, 1);
    for (index, view) in done.views.iter().enumerate() {
        let counts = view.halves[0].counts.pixels();
        let mean = counts.iter().sum::<u32>() as f64 / counts.len() as f64;
        let (least, most) = (*counts.iter().min().unwrap(), *counts.iter().max().unwrap());
        assert!(least >= 54 && most <= 110 && mean >= 64.0 && mean < 80.0, "view {index}: {least} {mean} {most}");
        if let Some(out) = std::env::var_os("MATEVAL_TEST_PICTURES") {
            let folder = std::path::Path::new(&out);
            let gray = view.halves[0].counts.map(|n| LinearRgb([n as f32 / 128.0; 3])).to_srgb();
            png_io::write_srgb(&folder.join(format!("counts_{index}.png")), &gray).unwrap();
            let picture = view.halves[0].basis.sum().to_srgb();
            png_io::write_srgb(&folder.join(format!("splatted_{index}.png")), &picture).unwrap();
        }
    }
    // Five views cost less than two: the union of the pictures and the surplus where they are stretched.
    let share = done.stats.paths as f64 / (48.0 * 48.0 * 64.0);
    assert!(share > 1.2 && share < 1.7, "{share}");
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let world = lit_world([[1.0; 3]; 4]);
    let groups = LightGroups::apart(4);
    let on_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render_views(&world, &views(), &groups, &settings(3), &[4, 5], &|_, _| ()).unwrap())
    };
    let one = on_threads(1);
    assert_eq!(one, on_threads(2));
    assert_eq!(one, on_threads(7));
    let other = render_views(&world, &views(), &groups, &settings(3), &[4, 6], &|_, _| ()).unwrap();
    assert_eq!(one.views[0].halves[0], other.views[0].halves[0]);
    assert_ne!(one.views[0].halves[1], other.views[0].halves[1]);
}

/// Cameras in different places, or looking different ways, get a pass each, with the pixels that they get alone.
#[test]
fn other_view_sets_fall_back_to_one_pass_a_view() {
    let world = lit_world([[1.0; 3]; 4]);
    let first = view(SIZE as u32);
    let moved = Camera::from_rotation(first.rotation(), first.position() + DVec3::X * 1e-3, first.intrinsics);
    let back = first.turned(0.0, 120.0);
    let rounded = Camera::from_rotation(first.rotation(), first.position() + DVec3::X * 1e-9, first.intrinsics);
    assert!(share_centre(&[first, rounded]) && share_centre(&views()));
    for other in [moved, back] {
        assert!(!share_centre(&[first, other]));
        let pair = rendered(&world, &[first, other], 2, 0..2);
        assert_eq!(pair.passes, 2);
        for (index, camera) in [first, other].iter().enumerate() {
            let alone = rendered(&world, &[*camera], 2, 0..2);
            assert_eq!(pair.views[index], alone.views[0]);
        }
    }
}

/// Views of other sizes and focal lengths share the paths too, each pixel with the samples asked for.
#[test]
fn views_may_differ_in_size() {
    let world = lit_world([[1.0; 3]; 4]);
    let fine =
        Camera { intrinsics: mateval_scene::Intrinsics::from_fov_x(48, 40, 0.5), ..view(SIZE as u32).turned(2.0, 9.0) };
    let done = rendered(&world, &[view(SIZE as u32), fine], 8, 0..8);
    assert_eq!(done.passes, 1);
    let counts = &done.views[1].halves[0].counts;
    assert_eq!((counts.width(), counts.height()), (48, 40));
    let mean = counts.pixels().iter().sum::<u32>() as f64 / (48.0 * 40.0);
    assert!(mean > 7.9 && mean < 11.0, "{mean}");
    let separate = Renders::new(&world, &fine, RenderSettings { seed: 7, ..settings(8) }, 8);
    let z = estimates(&done)[1].whole().z_against(&separate.whole());
    assert!(z.abs() < 4.0, "{z}");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let world = lit_world([[1.0; 3]; 4]);
    let message = |groups: &LightGroups, samples: u32, seeds: &[u64]| {
        let done = render_views(&world, &views(), groups, &settings(samples), seeds, &|_, _| ());
        done.unwrap_err().to_string()
    };
    assert!(message(&LightGroups::apart(4), 1, &[3, 4, 3]).contains("seed 3 occurs twice"));
    assert!(message(&LightGroups::apart(3), 1, &[3]).contains("groups of 3 lights for a scene of 4"));
    assert!(message(&LightGroups::apart(4), 0, &[3]).contains("0 samples"));
}
