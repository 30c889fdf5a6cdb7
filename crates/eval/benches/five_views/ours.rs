//! The five views by this project's tracer.

use std::path::Path;
use std::sync::Arc;

use mateval_dataset::Camera;
use mateval_image::{LinearRgb, Picture};
use mateval_light::light_fit::{FitRules, FitTarget, fit_lights};
use mateval_testkit::bench_scene;
use mateval_tracer::{RenderSettings, ViewLight, World, render_views};

use crate::stage::Stage;
use crate::{FIT_SIZE, Run, SAMPLES};

/// Samples a pixel of the pictures that the fit uses.
pub const STREAM_C_SAMPLES: u32 = 16;

/// The scene, ready for rays, and its camera; prints the time that this took.
pub fn load(folder: &Path) -> (World, Camera) {
    let ((scene, camera), read) = Stage::measure("read", 0, || bench_scene::read(folder, FIT_SIZE as u32));
    let (world, build) = Stage::measure("hierarchy", 0, || World::new(Arc::new(scene)).unwrap());
    for stage in [read, build] {
        println!("ours, {}: {:.2} CPU s, {:.2} wall s", stage.name, stage.cpu, stage.wall);
    }
    (world, camera)
}

/// Stream C, the fit, and both halves of all views for each number of samples.
pub fn run(world: &World, folder: &Path, input: Camera, cameras: &[Camera], round: u64) -> Run {
    let render = |cameras: &[Camera], samples: u32, seeds: &[u64]| {
        let settings = RenderSettings { samples, max_bounces: 6, ..Default::default() };
        render_views(world, cameras, &settings, seeds, &|_, _| ()).unwrap().views
    };
    let seed = 100 * round;
    let (stream_c, stage) =
        Stage::measure("stream C", STREAM_C_SAMPLES, || render(&[input], STREAM_C_SAMPLES, &[seed]));
    let mut stages = vec![stage];
    let photo = photo(folder);
    let (fit, stage) = Stage::measure("fit", 0, || {
        let target = FitTarget { photo: &photo, mask: None, exposure: 1.0, known: &[] };
        fit_lights(&FitRules::default(), &stream_c[0].by_seed[0], &target).unwrap()
    });
    stages.push(stage);
    let mut errors: Vec<f64> = fit.weights.iter().flatten().map(|weight| (weight - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    println!(
        "ours, fit: median error {:.3}, largest {:.3}, gap {:.1e}",
        errors[errors.len() / 2],
        errors[errors.len() - 1],
        fit.relative_gap
    );
    let mut pictures = Vec::new();
    for samples in SAMPLES {
        let seeds = [seed + u64::from(samples) + 1, seed + u64::from(samples) + 2];
        let (views, stage) = Stage::measure("two halves", samples, || {
            let views = render(cameras, samples / 2, &seeds);
            // The scored pictures; their noise is compared under the scene's own radiances.
            let halves = views.iter().flat_map(|view| &view.by_seed);
            let scored: Vec<_> = halves.map(|half| half.weighted(&fit.weights).unwrap()).collect();
            std::hint::black_box(scored);
            views
        });
        stages.push(stage);
        pictures.push(views.iter().flat_map(mean_of_halves).collect());
    }
    Run { stages, pictures }
}

fn mean_of_halves(view: &ViewLight) -> Vec<f32> {
    let [a, b] = [0, 1].map(|half| view.by_seed[half].sum());
    let channels = |p: Picture<LinearRgb>| p.into_pixels().into_iter().flat_map(|pixel| pixel.0);
    channels(a).zip(channels(b)).map(|(a, b)| (a + b) / 2.0).collect()
}

/// The scene's reference picture, by Mitsuba, at the size of the fit.
pub fn photo(folder: &Path) -> Picture<LinearRgb> {
    let large = bench_scene::reference(folder);
    Picture::from_fn(FIT_SIZE, FIT_SIZE, |x, y| {
        let nested = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[dx, dy]| large.get(2 * x + dx, 2 * y + dy).0);
        LinearRgb([0, 1, 2].map(|channel| nested.iter().map(|pixel| pixel[channel]).sum::<f32>() / 4.0))
    })
}
