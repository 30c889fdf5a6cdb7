//! Radiances fitted to the dataset's photo, under several rules.

use std::path::Path;

use mateval_eval::truth::{RgbTruth, ViewTruth};
use mateval_image::{Mask, Picture, SrgbRgb};
use mateval_light::light_fit::{FitTarget, fit_two_streams};
use mateval_light::rules::FitRules;
use mateval_tracer::{LightBasis, LightMix};

use crate::room::Room;

/// Pixels of the photo that are clipped: how they count.
const CLIPPED: [&str; 3] = ["at least", "left out", "as others"];
const RIDGES: [f64; 8] = [1e-6, 1e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 1e6];
/// Samples of each of the fit's streams, and of each half of the scored pictures.
const SAMPLES: [u32; 2] = [32, 32];

/// A view with its truth and both halves of the prediction under each light.
struct Scored {
    truth: [Picture<SrgbRgb>; 2],
    valid: Mask,
    halves: Vec<LightBasis>,
}

pub fn measure(room: &Room, submission: &Path) {
    println!("photo: {}", submission.display());
    let (views, exposure) = (&room.scene.views, room.scene.exposure);
    let renderer = room.dataset.file.scored_renderer.clone().unwrap();
    let truth = |view| RgbTruth::read(&room.folder, &renderer, view).unwrap();
    let streams = room.bases(submission, &views[..1], SAMPLES[0], &[11, 12]).remove(0);
    let bases = room.bases(submission, views, SAMPLES[1], &[21, 22]);
    let scored = views.iter().zip(bases).map(|(view, halves)| Scored {
        truth: truth(view).halves.map(|half| encoded(&half, exposure)),
        valid: ViewTruth::read(&room.folder, view).unwrap().valid,
        halves,
    });
    let scored: Vec<Scored> = scored.collect();
    let (photo, valid) = (truth(&views[0]).shown, &scored[0].valid);
    let clipped = |x, y| photo.get(x, y).0.iter().any(|v| f64::from(*v) * exposure >= 1.0);
    let unclipped = Mask::from_fn(photo.width(), photo.height(), |x, y| valid.get(x, y) && !clipped(x, y));
    let count = |mask: &Mask| mask.pixels().iter().filter(|set| **set).count();
    println!("  {} of {} valid pixels are clipped", count(valid) - count(&unclipped), count(valid));
    for how in CLIPPED {
        for ridge in RIDGES.into_iter().filter(|ridge| how == CLIPPED[0] || *ridge == room.rules.fit.ridge) {
            let target = match how {
                "at least" => FitTarget { photo: &photo, mask: Some(valid), exposure },
                "left out" => FitTarget { photo: &photo, mask: Some(&unclipped), exposure },
                _ => FitTarget { photo: &photo, mask: Some(valid), exposure: 1e-6 },
            };
            let rules = FitRules { ridge, ..room.rules.fit };
            let fit = fit_two_streams(&rules, [&streams[0], &streams[1]], &target).unwrap();
            let weights = fit.weights();
            let zeros = weights.iter().flatten().filter(|weight| **weight == 0.0).count();
            let [input, novel] = psnrs(&scored, &weights, exposure);
            let displaced = fit.streams.each_ref().map(|stream| psnrs(&scored, &stream.weights, exposure));
            let noise = [0, 1].map(|at| (displaced[0][at] - displaced[1][at]).abs() / 2.0);
            println!(
                "  clipped {how}, ridge {ridge:e}: {zeros} zeros, input {input:.3} dB (fit's noise {:.3}), novel {novel:.3} dB \
                 ({:.3}), gap {:.1e}",
                noise[0], noise[1], fit.streams[0].relative_gap
            );
            if ridge == room.rules.fit.ridge && how == CLIPPED[0] {
                let pairs = room.names.iter().zip(weights.iter().zip(fit.spread()));
                pairs.for_each(|(name, (weight, spread))| println!("    {name}: {weight:.3?}, spread {spread:.3?}"));
                println!(
                    "    start {:.3?}, steps {:?}",
                    fit.streams[0].start,
                    fit.streams[0].channels.each_ref().map(|c| c.steps)
                );
            }
        }
    }
}

/// PSNR of the input view, and the mean of the others'.
fn psnrs(scored: &[Scored], weights: &LightMix, exposure: f64) -> [f64; 2] {
    let psnr = |view: &Scored| {
        let halves = [0, 1].map(|half| encoded(&view.halves[half].weighted(weights).unwrap(), exposure));
        -10.0 * noise_free_mse(&halves, view).log10()
    };
    let all: Vec<f64> = scored.iter().map(psnr).collect();
    [all[0], all[1..].iter().sum::<f64>() / (all.len() - 1).max(1) as f64]
}

/// The mean product of both halves' errors over valid pixels.
fn noise_free_mse(halves: &[Picture<SrgbRgb>; 2], view: &Scored) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (at, _) in view.valid.pixels().iter().enumerate().filter(|(_, valid)| **valid) {
        for channel in 0..3 {
            let error = |half: usize| {
                f64::from(halves[half].pixels()[at].0[channel] - view.truth[half].pixels()[at].0[channel])
            };
            sum += error(0) * error(1);
            count += 1.0;
        }
    }
    sum / count
}

fn encoded(picture: &Picture<mateval_image::LinearRgb>, exposure: f64) -> Picture<SrgbRgb> {
    let exposed = |v: f32| (v * exposure as f32).clamp(0.0, 1.0);
    picture.map(|pixel| mateval_image::LinearRgb(pixel.0.map(exposed))).to_srgb()
}
