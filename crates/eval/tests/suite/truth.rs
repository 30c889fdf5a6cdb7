//! The truth is exact under every light at any number of samples, and the error that is stated for others is the
//! spread.

#![allow(clippy::print_stdout, reason = "measurements are printed")]

use std::path::{Path, PathBuf};

use mateval_eval::metric::Metric;
use mateval_eval::protocol::Protocol;
use mateval_eval::result::ProtocolResult;
use mateval_eval::result::key::ResultKey;
use mateval_image::exr_io::{self, Precision};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Picture, Wrap};
use mateval_testkit::kept_folder;

use super::sample::{hasty, lpips, plan, scored, write_changed, write_grey, write_truth};

fn samples(each_half: u32, seed: &str) -> Protocol {
    let mut protocol = hasty();
    protocol.light.samples.each_half = each_half;
    protocol.light.samples.seed = seed.to_owned();
    protocol
}

fn results(submissions: &[&Path], protocol: &Protocol, scenes: &[&str]) -> Vec<ProtocolResult> {
    let results = scored(&plan(submissions, protocol, scenes)).into_iter();
    results.map(|mut result| result.protocols.remove("mateval-3").unwrap()).collect()
}

/// Writes the truth with its base colours as floats: the same values at every lookup, and other texels in memory.
fn write_floats(out: &Path) {
    write_truth(out);
    let below = |folder: PathBuf| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut count = 0;
    for instance in below(out.join("scenes")).flat_map(below) {
        let path = instance.join("base_color.png");
        let texture = read_texture(&path, Encoding::Srgb, Wrap::Clamp).unwrap();
        let picture = Picture::from_fn(texture.width(), texture.height(), |x, y| LinearRgb(texture.texel(x, y)));
        exr_io::write_linear(&path.with_extension("exr"), &picture, Precision::Float).unwrap();
        std::fs::remove_file(path).unwrap();
        count += 1;
    }
    assert!(count > 10, "{count}");
}

/// For a copy of the truth no path is traced. The truth as floats is another submission for the scorer, so that its
/// paths are traced, and the difference is zero all the same.
#[test]
fn the_truth_is_exact_at_any_number_of_samples() {
    let [truth, floats] = ["gt", "floats"].map(|name| kept_folder("exact").join(name));
    write_truth(&truth);
    write_floats(&floats);
    let lpips = lpips();
    for each_half in [2, 6] {
        let mut plan = plan(&[&truth, &floats], &samples(each_half, "other"), &[]);
        if let Some(lpips) = &lpips {
            let again = mateval_metrics::Lpips::load(
                lpips.net(),
                &mateval_testkit::lpips_weights(lpips.net().file_name()).unwrap(),
            );
            plan.lpips = mateval_eval::score::LpipsWeights::Loaded(Box::new(again.unwrap()));
        }
        for mut result in scored(&plan) {
            let result = result.protocols.remove("mateval-3").unwrap();
            let light: Vec<_> = result.pictures.iter().filter(|picture| picture.picture.kind.is_light()).collect();
            assert!(light.len() > 40, "{}", light.len());
            for picture in light.iter().filter(|picture| picture.pixels > 0) {
                assert!(picture.exact && picture.mse_error == Some(0.0), "{picture:?}");
                for (metric, value) in &picture.values {
                    let best = match metric {
                        Metric::Psnr => 100.0,
                        Metric::Ssim => 1.0,
                        _ => 0.0,
                    };
                    assert_eq!(*value, best, "{metric} {picture:?}");
                }
            }
        }
    }
}

/// Independent seeds.
const SEEDS: usize = 10;

/// Over the whole chain of `room`, whose lamps are small and whose surfaces are mirrors, metal and glass: for each kind
/// of submission and mean, the stated error is the spread over seeds, and the mean that of many samples.
#[test]
fn the_stated_error_is_the_spread() {
    let folder = kept_folder("spread");
    let submissions: Vec<(&str, PathBuf)> = ["grey", "dark", "tinted"].map(|name| (name, folder.join(name))).to_vec();
    write_grey(&submissions[0].1);
    let times = |factor: [f32; 3]| {
        move |truth: &Picture<LinearRgb>| truth.map(|LinearRgb(rgb)| LinearRgb([0, 1, 2].map(|c| factor[c] * rgb[c])))
    };
    write_changed(&submissions[1].1, times([0.7; 3]));
    write_changed(&submissions[2].1, times([1.0, 0.8, 0.5]));
    let paths: Vec<&Path> = submissions.iter().map(|(_, path)| path.as_path()).collect();
    let all: Vec<Vec<ProtocolResult>> =
        (0..SEEDS).map(|seed| results(&paths, &samples(8, &format!("seed {seed}")), &["room"])).collect();
    let exact = results(&paths, &samples(96, "exact"), &["room"]);
    let mut ratios = Vec::new();
    for (at, (name, _)) in submissions.iter().enumerate() {
        for key in ["rgb_true.input.psnr", "rgb_true.novel.psnr", "rgb_relit.input.psnr", "rgb_relit.novel.psnr"] {
            let key: ResultKey = key.parse().unwrap();
            let values: Vec<f64> = all.iter().map(|results| results[at].summary[&key]).collect();
            let stated: Vec<f64> = all.iter().map(|results| results[at].summary_noise[&key]).collect();
            let (mean, spread) = mean_and_spread(&values);
            let (stated, _) = mean_and_spread(&stated);
            let bias = mean - exact[at].summary[&key];
            println!(
                "{name} {key}: {mean:.2} dB, bias {bias:.3}, spread {spread:.3}, stated over spread {:.2}",
                stated / spread
            );
            assert!(bias.abs() < 0.1 + 3.0 * spread / (SEEDS as f64).sqrt(), "{name} {key}: {bias}");
            ratios.push(stated / spread);
        }
    }
    let geometric = (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
    println!("geometric mean {geometric:.2} of {ratios:.2?}");
    // Ten seeds know a spread to 24 %.
    assert!((0.7..1.45).contains(&geometric) && ratios.iter().all(|ratio| (0.4..2.5).contains(ratio)), "{ratios:?}");
}

fn mean_and_spread(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (values.len() - 1) as f64).sqrt())
}
