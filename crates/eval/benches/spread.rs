//! The stated error of renders against their spread over seeds, and their bias against many samples, on any dataset:
//!
//! ```text
//! cargo bench -p mateval-eval --bench spread -- DATASET SCENE SEEDS SAMPLES REFERENCE_SAMPLES SUBMISSION...
//! ```
//!
//! SAMPLES per pixel of each half are those of the protocol if 0; REFERENCE_SAMPLES are those of the run that stands
//! for the exact value. Prints a row for each submission and number of light: its mean over seeds, its bias, its
//! spread, and, of PSNR, the stated error divided by the spread.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "measurements are printed")]

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::SceneId;
use mateval_dataset::open::Dataset;
use mateval_eval::metric::Metric;
use mateval_eval::protocol::Protocol;
use mateval_eval::result::ProtocolResult;
use mateval_eval::result::key::{ResultKey, Surfaces, Views};
use mateval_eval::score::{LpipsWeights, ScorePlan, score};
use mateval_metrics::{Lpips, Net};
use mateval_testkit::lpips_weights;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let [dataset, scene, seeds, samples, exact, submissions @ ..] = words.as_slice() else {
        return Err("expected DATASET SCENE SEEDS SAMPLES REFERENCE_SAMPLES SUBMISSION...".into());
    };
    let dataset = Dataset::open(Path::new(dataset))?;
    let scene = SceneId::new(scene)?;
    let (seeds, samples, exact): (usize, u32, u32) = (seeds.parse()?, samples.parse()?, exact.parse()?);
    let scored = |seed: &str, samples: u32| -> Result<Vec<ProtocolResult>, Box<dyn std::error::Error>> {
        let mut protocol = Protocol::named("mateval-3")?;
        protocol.light.samples.seed = seed.to_owned();
        if samples > 0 {
            protocol.light.samples.each_half = samples;
        }
        let submissions = submissions.iter().map(Path::new).collect();
        let lpips = match lpips_weights(Net::Alex.file_name()) {
            Some(weights) => LpipsWeights::Loaded(Box::new(Lpips::load(Net::Alex, &weights)?)),
            None => LpipsWeights::Missing { reason: "not measured".to_owned(), fix: String::new() },
        };
        let plan = ScorePlan::new(&dataset, submissions, vec![protocol], lpips, "spread");
        let plan = ScorePlan { scenes: vec![scene.clone()], ..plan };
        let results = score(&plan, &|_| ())?;
        Ok(results.into_iter().map(|mut result| result.protocols.remove("mateval-3").expect("it was scored")).collect())
    };
    let mut all = Vec::new();
    for seed in 0..seeds {
        eprintln!("seed {seed}");
        all.push(numbers(&scored(&format!("seed {seed}"), samples)?));
    }
    eprintln!("reference");
    let reference = numbers(&scored("reference", exact)?);
    let mut ratios: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    println!("submission               number                       mean      bias    spread  stated/spread");
    for (key, exact) in &reference {
        let values: Vec<f64> = all.iter().filter_map(|run| run.get(key)).map(|value| value.mean).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let spread = (squares / (values.len() as f64 - 1.0)).sqrt();
        let stated =
            all.iter().filter_map(|run| run.get(key)).map(|value| value.error).sum::<f64>() / values.len() as f64;
        let (submission, number) = key;
        let name = &submissions[*submission];
        let bias = mean - exact.mean;
        println!("{name:24} {number:27} {mean:8.4} {bias:+8.4} {spread:9.4} {:8.2}", stated / spread);
        if spread > 0.0 && stated > 0.0 {
            ratios.entry(name).or_default().push(stated / spread);
        }
    }
    for (name, ratios) in ratios {
        let geometric = (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
        println!("{name}: geometric mean of stated over spread {geometric:.2} over {} rows", ratios.len());
    }
    Ok(())
}

/// A number and, of PSNR, its stated error.
#[derive(Clone, Copy, Default)]
struct Value {
    mean: f64,
    error: f64,
}

/// By submission and name of the number: the means of a result, and the input view in each lighting.
fn numbers(results: &[ProtocolResult]) -> BTreeMap<(usize, String), Value> {
    let mut all = BTreeMap::new();
    for (submission, result) in results.iter().enumerate() {
        let has_noise =
            |key: &ResultKey| key.picture.kind.is_light() && !matches!(key.metric, Metric::Mse | Metric::Psnr);
        for (key, mean) in &result.summary {
            let error = result.summary_noise.get(key).copied();
            if error.is_some() || has_noise(key) {
                all.insert((submission, key.to_string()), Value { mean: *mean, error: error.unwrap_or_default() });
            }
        }
        for picture in result.pictures.iter().filter(|picture| picture.picture.surfaces == Surfaces::All) {
            let (Some(lighting), Views::Input) = (picture.lighting, picture.key(Metric::Psnr).views) else { continue };
            let [mse, psnr] = [Metric::Mse, Metric::Psnr].map(|metric| picture.values.get(&metric).copied());
            if let (Some(mse), Some(psnr), Some(error)) = (mse, psnr, picture.mse_error) {
                let error = 10.0 / std::f64::consts::LN_10 * error / mse.max(1.645 * error);
                all.insert((submission, format!("{lighting}.input")), Value { mean: psnr, error });
            }
        }
    }
    all
}
