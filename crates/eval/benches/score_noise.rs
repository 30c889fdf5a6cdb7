//! How far scores of light move with the seed, against what they state and against converged renders:
//! `cargo bench --workspace --bench score_noise -- DATASET SCENE WEIGHTS SEEDS SAMPLES SUBMISSION...`, where WEIGHTS is the
//! file with Alex' weights and SAMPLES the number per half, or 0 for the number that the pilot finds.
//!
//! Every submission is scored with SEEDS different seeds of paths and companions, of which each seed makes its own, as many
//! samples as the protocol says, and once with 256 samples per half and companions of 512 per
//! half, which are as certain as thousands without companions. A
//! row is the mean of a metric over the views of one lighting. For PSNR it shows the ratio of the stated standard error
//! (without the truth's, which all seeds share) to the spread over seeds; for every metric the distance of the seeds' mean
//! from the converged value, and their spread.
#![allow(clippy::print_stdout, clippy::unwrap_used)] // a table, of files that the caller names

use std::collections::BTreeMap;
use std::path::Path;

use mateval_eval::metric::Metric;
use mateval_eval::protocol::Protocol;
use mateval_eval::result::{ProtocolResult, PsnrNoise};
use mateval_eval::result_key::{ResultKey, Surfaces};
use mateval_eval::score::{LpipsWeights, ScorePlan, score};
use mateval_metrics::{Lpips, Net};
use mateval_scene::SceneId;
use mateval_scene::open::Dataset;

/// Samples per half of the renders that count as converged.
const CONVERGED: u32 = 256;

/// A picture's key, and its lighting.
type Row = (ResultKey, String);

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let [dataset, scene, weights, seeds, samples, submissions @ ..] = words.as_slice() else {
        println!("give DATASET SCENE WEIGHTS SEEDS SAMPLES SUBMISSION...: nothing measured");
        return;
    };
    let dataset = Dataset::open(Path::new(dataset)).unwrap();
    let scene = SceneId::new(scene).unwrap();
    let scored = |protocol: Protocol| {
        let plan = ScorePlan {
            dataset: &dataset,
            submissions: submissions.iter().map(Path::new).collect(),
            protocols: vec![protocol],
            scenes: vec![scene.clone()],
            lpips: LpipsWeights::Loaded(Box::new(Lpips::load(Net::Alex, Path::new(weights)).unwrap())),
            tool: "bench".to_owned(),
            jobs: 1,
            cache: None,
            only_cached: false,
            companion_cache: None,
        };
        let results = score(&plan, &|_| ()).unwrap().into_iter();
        results.map(|mut result| result.protocols.pop_first().unwrap().1).collect::<Vec<ProtocolResult>>()
    };
    let (seeds, samples): (usize, u32) = (seeds.parse().unwrap(), samples.parse().unwrap());
    for name in Protocol::NAMES {
        let with = |seed: &str, companion_samples: Option<u32>, samples: u32| {
            let mut protocol = Protocol::named(name).unwrap();
            let noise = &mut protocol.light.noise;
            noise.seed = seed.to_owned();
            if let Some(samples) = companion_samples {
                (noise.least_companion_samples, noise.most_companion_samples) = (samples, samples);
            }
            if samples > 0 {
                (noise.least_samples, noise.most_samples) = (samples, samples);
            }
            protocol.light.fit.samples = protocol.light.fit.samples.max(samples);
            scored(protocol)
        };
        let converged = with("converged", Some(2 * CONVERGED), CONVERGED);
        let all: Vec<Vec<ProtocolResult>> =
            (0..seeds).map(|seed| with(&format!("seed {seed}"), None, samples)).collect();
        for (at, submission) in submissions.iter().enumerate() {
            println!("\n{name}, {submission}");
            print_rows(&converged[at], &all.iter().map(|results| &results[at]).collect::<Vec<_>>());
        }
    }
}

fn print_rows(converged: &ProtocolResult, seeds: &[&ProtocolResult]) {
    println!("| picture | converged | seeds less converged | spread | bias in spreads | stated / spread | samples |");
    println!("|---|---:|---:|---:|---:|---:|---:|");
    let all: Vec<BTreeMap<Row, f64>> = seeds.iter().map(|result| rows(result)).collect();
    for (row, exact) in rows(converged) {
        let values: Vec<f64> = all.iter().filter_map(|rows| rows.get(&row).copied()).collect();
        if values.len() != seeds.len() {
            println!("| {} {} | {exact:.4} | {} of {} seeds |", row.0, row.1, values.len(), seeds.len());
            continue;
        }
        let (bias, spread) = (mean(&values) - exact, spread(&values));
        // The noise of a result belongs to all lightings of a key together.
        let stated: Vec<&PsnrNoise> =
            seeds.iter().filter_map(|result| result.noise.values().next()?.get(&row.0)).collect();
        let error = |noise: &PsnrNoise| {
            [noise.own_db, noise.companions_db, noise.fit_db].iter().flatten().map(|db| db * db).sum::<f64>()
        };
        let shown = if row.1.is_empty() && !stated.is_empty() {
            let root = mean(&stated.iter().map(|noise| error(noise)).collect::<Vec<_>>()).sqrt();
            let samples = mean(&stated.iter().map(|noise| f64::from(noise.samples)).collect::<Vec<_>>());
            format!("{:.2} | {samples:.0}", root / spread)
        } else {
            " | ".to_owned()
        };
        println!("| {} {} | {exact:.5} | {bias:+.5} | {spread:.5} | {:+.2} | {shown} |", row.0, row.1, bias / spread);
    }
}

/// Means over views: of each lighting alone, and of all together.
fn rows(result: &ProtocolResult) -> BTreeMap<Row, f64> {
    let mut values: BTreeMap<Row, Vec<f64>> = BTreeMap::new();
    for picture in &result.pictures {
        let is_light = picture.picture.kind.is_light() && picture.picture.surfaces == Surfaces::All;
        let Some(value) = picture.value.filter(|_| is_light) else { continue };
        let lighting = picture.lighting.map(|lighting| lighting.to_string());
        if let (Some(lighting), true) = (&lighting, picture.metric != Metric::Psnr) {
            values.entry((picture.key(), lighting.clone())).or_default().push(value);
        }
        values.entry((picture.key(), String::new())).or_default().push(value);
    }
    values.into_iter().map(|(row, values)| (row, mean(&values))).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard deviation.
fn spread(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (values.len().max(2) - 1) as f64).sqrt()
}
