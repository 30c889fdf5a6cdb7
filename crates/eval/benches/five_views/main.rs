//! Measures the cost of a scene's five views with fitted lights, with our tracer and with Mitsuba.
//!
//! `MATEVAL_PEERS_PYTHON=... cargo bench --workspace --bench five_views -- [quick|full]` on `bench/dense` (864,036
//! triangles, 15 emitters), 480 x 270 pixels, 6 bounces (Mitsuba's max_depth 8). Ours: a light basis of the input view
//! at 256 x 256 pixels (stream C), the fit, and two halves of all five views' light bases in one pass. Mitsuba's:
//! radiances fitted by `prb` and Adam, with 100 iterations at 256 x 256 pixels and 16 samples (our assumption, since no
//! number is published), then five renders. `quick` times 10 iterations and scales the result; `scalar_rgb` cannot fit,
//! so only its renders count. The tools run alternately.
//!
//! Times are compared at equal noise: MSE falls as 1 / samples, so the time of Mitsuba's renders is multiplied by its
//! MSE divided by ours. A quarter of the samples is used to check this. A tool's MSE relative to the picture that it
//! converges to is half the mean square of the difference of two independent pictures, which needs no converged
//! picture. The mean product of differences of independent pairs shows whether both tools converge to the same picture.

#![allow(clippy::unwrap_used, reason = "a bench that cannot be set up has failed")]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a bench prints")]

mod mitsuba;
mod noise;
mod ours;
mod stage;

use mateval_dataset::{Camera, Intrinsics};
use mateval_testkit::bench_scene;
use noise::{Noise, disagreement};
use stage::{Stage, find};

/// Pixels of a view, as in datasets by default.
pub const SIZE: [usize; 2] = [480, 270];
/// Pixels of the pictures that Mitsuba fits.
pub const FIT_SIZE: usize = 256;
/// Samples a pixel, both halves together.
const SAMPLES: [u32; 2] = [16, 64];
const OFFSETS: [[f64; 2]; 5] = [[0.0, 0.0], [5.0, 5.0], [5.0, -5.0], [-5.0, 5.0], [-5.0, -5.0]];

/// One run of a tool on a scene.
pub struct Run {
    /// The stages and their times.
    pub stages: Vec<Stage>,
    /// For each of [`SAMPLES`], all views' pictures one after the other, linear RGB.
    pub pictures: Vec<Vec<f32>>,
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if !words.iter().any(|word| word == "--bench") {
        return println!("five_views: nothing is measured unless run by `cargo bench`");
    }
    let full = words.iter().any(|word| word == "full");
    let Some(folder) = bench_scene::folder("dense") else { return };
    let python = std::env::var_os("MATEVAL_PEERS_PYTHON");
    let variants: &[&str] = if python.is_some() { &["llvm_ad_rgb", "scalar_rgb"] } else { &[] };
    if variants.is_empty() {
        eprintln!("SKIPPED: Mitsuba's half of five_views: MATEVAL_PEERS_PYTHON names no Python with mitsuba");
    }
    let (world, input) = ours::load(&folder);
    let cameras = OFFSETS.map(|[x, y]| sized(input).turned(x, y));
    let mut own = Vec::new();
    let mut theirs: Vec<Vec<Run>> = variants.iter().map(|_| Vec::new()).collect();
    for round in 0..2 {
        own.push(ours::run(&world, &folder, input, &cameras, round));
        for (runs, variant) in theirs.iter_mut().zip(variants) {
            // Scalar is slow, so only its renders with fewer samples are timed and then scaled.
            let fits = round == 0 && *variant != "scalar_rgb";
            let iterations = if fits { if full { 100 } else { 10 } } else { 0 };
            let samples = if *variant == "scalar_rgb" && !full { &SAMPLES[..1] } else { &SAMPLES };
            runs.push(mitsuba::run(python.as_ref().unwrap(), &folder, &cameras, variant, round, iterations, samples));
        }
    }
    report(&own, variants, &theirs);
}

/// The same view with other pixels and the same horizontal field of view.
fn sized(camera: Camera) -> Camera {
    let [width, height] = SIZE.map(|v| v as u32);
    let own = camera.intrinsics;
    let focal = own.fx * f64::from(width) / f64::from(own.width);
    let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
    Camera { intrinsics: Intrinsics { width, height, fx: focal, fy: focal, cx, cy }, ..camera }
}

fn report(own: &[Run], variants: &[&str], theirs: &[Vec<Run>]) {
    println!("\n| tool | stage | samples | CPU s | wall s |\n|---|---|---|---|---|");
    let rows = |tool: &str, runs: &[Run]| {
        for stage in runs.iter().flat_map(|run| &run.stages) {
            println!("| {tool} | {} | {} | {:.2} | {:.2} |", stage.name, stage.samples, stage.cpu, stage.wall);
        }
    };
    rows("ours", own);
    variants.iter().zip(theirs).for_each(|(variant, runs)| rows(variant, runs));
    let own_noise: Vec<Noise> =
        (0..SAMPLES.len()).map(|k| Noise::of(&own[0].pictures[k], &own[1].pictures[k])).collect();
    println!("\n| tool | samples | MSE linear | MSE clipped sRGB | samples x MSE sRGB |\n|---|---|---|---|---|");
    noise_rows("ours", &own_noise);
    for (variant, runs) in variants.iter().zip(theirs) {
        let noise: Vec<Noise> =
            (0..runs[0].pictures.len()).map(|k| Noise::of(&runs[0].pictures[k], &runs[1].pictures[k])).collect();
        noise_rows(variant, &noise);
        let last = runs[0].pictures.len() - 1;
        let pair = |runs: &[Run]| [runs[0].pictures[last].clone(), runs[1].pictures[last].clone()];
        println!("| {variant}, squared difference from ours | | {} |", disagreement(pair(own), pair(runs)));
        compare(own, &own_noise, variant, runs, &noise);
    }
}

fn noise_rows(tool: &str, noise: &[Noise]) {
    for (noise, samples) in noise.iter().zip(SAMPLES) {
        let product = noise.srgb * f64::from(samples);
        println!("| {tool} | {samples} | {:.3e} | {:.3e} | {product:.4e} |", noise.linear, noise.srgb);
    }
}

/// Times of both tools at the noise of ours, for both numbers of samples.
fn compare(own: &[Run], own_noise: &[Noise], variant: &str, runs: &[Run], noise: &[Noise]) {
    let fit = find(&runs[0].stages, "fit", None).map(|stage| stage.scaled_to_iterations(100));
    for (k, samples) in SAMPLES.into_iter().enumerate() {
        let known = k.min(noise.len() - 1);
        let at_equal = noise[known].srgb * f64::from(SAMPLES[known]) / (own_noise[k].srgb * f64::from(samples));
        let render = Stage::mean(runs, "render", SAMPLES[known]).times(f64::from(samples) / f64::from(SAMPLES[known]));
        let ours = Stage::mean(own, "stream C", ours::STREAM_C_SAMPLES)
            .plus(&Stage::mean(own, "fit", 0))
            .plus(&Stage::mean(own, "two halves", samples));
        let theirs = |render: &Stage| fit.as_ref().map_or(render.clone(), |fit| render.plus(fit));
        let (same_samples, same_noise) = (theirs(&render), theirs(&render.times(at_equal)));
        println!(
            "{variant}{}, {samples} samples: ours {:.1} CPU s ({:.1} wall); theirs {:.1} ({:.1}) at as many samples, \
             {:.1} ({:.1}) at equal noise (x{at_equal:.3}): ratio {:.1} CPU, {:.1} wall; renders alone {:.2} CPU",
            if fit.is_some() { " with 100 iterations" } else { " without a fit" },
            ours.cpu,
            ours.wall,
            same_samples.cpu,
            same_samples.wall,
            same_noise.cpu,
            same_noise.wall,
            same_noise.cpu / ours.cpu,
            same_noise.wall / ours.wall,
            render.cpu * at_equal / Stage::mean(own, "two halves", samples).cpu,
        );
    }
}
