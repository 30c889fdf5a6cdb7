//! Planted radiances, by samples of the light basis.
//!
//! Radiances of 0.5 to 3.5, different for every light and channel. The photo is rendered with one seed and the basis with
//! another, both with the submission's materials, so that only noise and the ridge affect the fit. For each light the bench
//! prints its share of the photo, the noise of the averaged squares between photo and basis, and the radiances that were
//! found.

use std::path::Path;
use std::time::Instant;

use mateval_eval::truth::ViewTruth;
use mateval_light::light_fit::{FitTarget, fit_lights, pooled};
use mateval_light::rules::FitRules;
use mateval_tracer::LightBasis;

use crate::room::Room;

pub fn measure(room: &Room, submission: &Path) {
    let views = &room.scene.views[..1];
    let valid = ViewTruth::read(&room.folder, &views[0]).unwrap().valid;
    let basis = |samples: u32, seed: u64| room.bases(submission, views, samples, &[seed]).remove(0).remove(0);
    let weights: Vec<[f64; 3]> = (0..room.names.len()).map(planted).collect();
    let photo = basis(64, 99);
    let photo_of_lights = photo.weighted(&weights).unwrap();
    // Planted lights are too bright for the scene's exposure; nothing of the photo shall be clipped.
    let target = FitTarget { photo: &photo_of_lights, mask: Some(&valid), exposure: 1e-3 };
    for (samples, ridge) in [(64, 1e-6), (16, room.rules.fit.ridge), (64, room.rules.fit.ridge)] {
        let start = Instant::now();
        let basis = basis(samples, 7);
        let seconds = start.elapsed().as_secs_f64();
        let fit = fit_lights(&FitRules { ridge, ..room.rules.fit }, &basis, &target).unwrap();
        let (errors, shares) = (errors(&fit.weights, &weights), shares(&basis, &weights));
        println!(
            "planted: basis {samples} ({seconds:.1} s), ridge {ridge:e}: median error {:.3}, by share of the photo's light \
             {:.3}, zeros {}",
            median(&mut errors.clone()),
            errors.iter().zip(&shares).map(|(error, share)| error * share).sum::<f64>() / shares.iter().sum::<f64>(),
            fit.weights.iter().flatten().filter(|weight| **weight == 0.0).count(),
        );
        for light in 0..weights.len() {
            let share = (0..3).map(|c| shares[3 * light + c]).sum::<f64>() / shares.iter().sum::<f64>();
            let pair = [&basis, &photo].map(|basis| pooled(&room.rules.fit, &basis.pictures()[light], Some(&valid)));
            println!(
                "  {}: share {share:.3}, noise of its squares {:.4}, found {:.3?}, planted {:.3?}",
                room.names[light],
                noise(&pair[0][1], &pair[1][1]),
                fit.weights[light],
                weights[light],
            );
        }
    }
}

/// Root mean square of the difference of two pictures of squares, divided by the mean of the second.
fn noise(a: &[f64], b: &[f64]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / a.len() as f64).sqrt() / (b.iter().sum::<f64>() / b.len() as f64)
}

fn planted(light: usize) -> [f64; 3] {
    [0, 1, 2].map(|c| 0.5 + 3.0 * ((light * 7 + c * 5) % 11) as f64 / 10.0)
}

/// Values for every light and channel.
fn errors(found: &[[f64; 3]], planted: &[[f64; 3]]) -> Vec<f64> {
    found.iter().flatten().zip(planted.iter().flatten()).map(|(found, planted)| (found / planted - 1.0).abs()).collect()
}

/// The contribution of each light and channel to the photo.
fn shares(basis: &LightBasis, weights: &[[f64; 3]]) -> Vec<f64> {
    let sum = |at: usize, c: usize| {
        let pixels = basis.pictures()[at].pixels();
        weights[at][c] * pixels.iter().map(|pixel| f64::from(pixel.0[c])).sum::<f64>()
    };
    (0..weights.len()).flat_map(|at| [0, 1, 2].map(|c| sum(at, c))).collect()
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
