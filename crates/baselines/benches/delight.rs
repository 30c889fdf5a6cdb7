//! De-lights the photos of a dataset and compares the base colours with the truth of the input view.
//!
//! `cargo bench -p mateval-baselines --bench delight -- DATASET [SCENE...]` prints for each scene the PSNR of base colour in the
//! input view (linear values shown as sRGB, over valid pixels), as it is and with the best scale of each channel, of:
//! the photo itself; the photo divided by light that is fitted as if everything were grey; the de-lit photo with the
//! lights of a stage alone; with everything that may glow but without the photo as light cache; and as the command makes
//! it. Seconds are CPU seconds of all threads. `DELIGHT_OUT` names a
//! folder for its pictures.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]

use std::collections::BTreeMap;
use std::path::PathBuf;

use mateval_baselines::delight::{CandidateLights, DelightOptions, DelitPhoto, delight};
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::geometry::SceneGeometry;
use mateval_dataset::open::Dataset;
use mateval_dataset::scene_cost::processor_time;
use mateval_image::exr_io::read_linear;
use mateval_image::png_io::write_srgb;
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_light::joint_fit::JointFitRules;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let Some(dataset) = words.first() else {
        println!("usage: cargo bench -p mateval-baselines --bench delight -- DATASET [SCENE...]");
        return;
    };
    let dataset = Dataset::open(&PathBuf::from(dataset)).unwrap();
    // One colour for all parts: radiances are fitted as if everything were grey, then the photo is divided.
    let grey = JointFitRules { color_prior: 1e6, usual_color: 0.5, ..JointFitRules::default() };
    let variants = [
        (
            "grey, divided",
            DelightOptions {
                fit: grey,
                samples: [64; 3],
                photo_cache: false,
                most_rounds: 1,
                ..DelightOptions::default()
            },
        ),
        ("stage lights", DelightOptions { lights: CandidateLights::Stage, ..DelightOptions::default() }),
        ("no photo cache", DelightOptions { photo_cache: false, ..DelightOptions::default() }),
        ("delight", DelightOptions::default()),
    ];
    for scene in dataset.scenes.iter().filter(|scene| words.len() == 1 || words[1..].contains(&scene.id.to_string())) {
        let folder = dataset.folder(&scene.id);
        let geometry = SceneGeometry::read(folder.clone(), scene).unwrap();
        let truth = read_linear(&folder.truth_view(&geometry.view.id).join("albedo.exr")).unwrap();
        println!("{}", scene.id);
        let photo = EstimateSource::Input.read(&dataset, scene, &|_| ()).unwrap().base_color.unwrap();
        line("photo", &photo, &truth, &geometry.valid, "");
        for (name, options) in &variants {
            let before = processor_time().unwrap_or_default().as_secs_f64();
            let found = delight(&geometry, options, &|_| ()).unwrap();
            let seconds = processor_time().unwrap_or_default().as_secs_f64() - before;
            let more = format!("{} rounds, {seconds:.0} s", found.rounds);
            line(name, &found.base_color, &truth, &geometry.valid, &more);
            if *name == "delight" {
                surfaces(&found, &geometry.valid);
            }
            if let Some(out) = std::env::var_os("DELIGHT_OUT").filter(|_| *name == "delight") {
                let out = PathBuf::from(out);
                std::fs::create_dir_all(&out).unwrap();
                let pictures = [("base_color", &found.base_color), ("shading", &found.shading), ("truth", &truth)];
                for (what, picture) in pictures {
                    write_srgb(&out.join(format!("{}_{what}.png", scene.id)), &picture.to_srgb()).unwrap();
                }
            }
        }
    }
}

/// The pixels of each roughness, and those of mirrors.
fn surfaces(found: &DelitPhoto, valid: &Mask) {
    let mut pixels: BTreeMap<u32, usize> = BTreeMap::new();
    for (roughness, _) in found.roughness.pixels().iter().zip(valid.pixels()).filter(|(_, valid)| **valid) {
        *pixels.entry((100.0 * roughness).round() as u32).or_default() += 1;
    }
    let mirrors = found.metallic.pixels().iter().filter(|metallic| **metallic > 0.0).count();
    println!("  pixels by roughness in % {pixels:?}, of mirrors {mirrors}");
}

fn line(name: &str, found: &Picture<LinearRgb>, truth: &Picture<LinearRgb>, valid: &Mask, more: &str) {
    let aligned = scaled(found, truth, valid);
    println!(
        "  {name:<16} {:>6.2} dB, aligned {:>6.2} dB {more}",
        psnr(found, truth, valid),
        psnr(&aligned, truth, valid)
    );
}

/// Each channel at the scale that fits the truth best, as the protocol aligns pictures.
fn scaled(found: &Picture<LinearRgb>, truth: &Picture<LinearRgb>, valid: &Mask) -> Picture<LinearRgb> {
    let scales = [0, 1, 2].map(|c| {
        let (mut product, mut square) = (0.0_f64, 0.0_f64);
        for ((p, gt), _) in found.pixels().iter().zip(truth.pixels()).zip(valid.pixels()).filter(|(_, valid)| **valid) {
            product += f64::from(p.0[c]) * f64::from(gt.0[c]);
            square += f64::from(p.0[c]) * f64::from(p.0[c]);
        }
        (product / square.max(f64::MIN_POSITIVE)) as f32
    });
    found.map(|LinearRgb(rgb)| LinearRgb([0, 1, 2].map(|c| rgb[c] * scales[c])))
}

fn psnr(found: &Picture<LinearRgb>, truth: &Picture<LinearRgb>, valid: &Mask) -> f64 {
    let (found, truth) = (found.map(|p| LinearRgb(p.0.map(|v| v.clamp(0.0, 1.0)))).to_srgb(), truth.to_srgb());
    let pairs = found.pixels().iter().zip(truth.pixels()).zip(valid.pixels()).filter(|(_, valid)| **valid);
    let (mut sum, mut count) = (0.0_f64, 0);
    for ((a, b), _) in pairs {
        sum += (0..3).map(|c| f64::from(a.0[c] - b.0[c]) * f64::from(a.0[c] - b.0[c])).sum::<f64>();
        count += 3;
    }
    10.0 * (f64::from(count) / sum).log10()
}
