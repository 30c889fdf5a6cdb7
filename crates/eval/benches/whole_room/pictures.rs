//! Pictures of both tools and their noise.

use std::f64::consts::LN_10;

use mateval_eval::metric::Metric;
use mateval_eval::noise_blocks::noise_blocks;
use mateval_eval::result::ResultFile;
use mateval_eval::result_key::{PictureKind, ResultKey, Views};
use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::{Halves, NoiseFreeMse, NoisyHalf, NoisyRender, noise_free_mse, psnr_mean_error};
use mateval_scene::material::PrincipledFlavour;
use mateval_tracer::{Coat, LightMix, Lighting, Repaint, StageLight, World, render_repainted};

use crate::noise::Noise;
use crate::room::Room;

/// The first of a room's views.
const INPUT_VIEWS: usize = 1;

/// A picture of light.
pub type Linear = Picture<LinearRgb>;

/// Two independent pictures of every view.
pub type Pair = [Vec<Linear>; 2];

/// The noise of a tool's pictures.
pub struct TrackNoise {
    /// The variance of a pixel, times samples a pixel.
    pub variance: f64,
    /// The square of the standard error of the mean PSNR, in dB squared, times samples a pixel; the larger of the input
    /// view's and the novel views'.
    pub certified: f64,
}

/// The key of a track's PSNR (see [`crate::TRACKS`]).
fn psnr(track: usize, views: Views) -> ResultKey {
    ResultKey::whole([PictureKind::RgbTrue, PictureKind::RgbFitted][track], views, Metric::Psnr)
}

/// Samples a pixel and half that the tracks took.
pub fn samples(scored: &ResultFile) -> [u32; 2] {
    let noise = scored.protocols["mateval-2"].noise.values().next().unwrap();
    [0, 1].map(|track| noise[&psnr(track, Views::Input)].samples)
}

/// The fitted radiances, light by light.
pub fn radiances(room: &Room, scored: &ResultFile) -> LightMix {
    scored.protocols["mateval-2"].fits[&room.scene.id].lights.iter().map(|light| light.radiance).collect()
}

/// Two independent halves of every view under the lights of track `track` (see [`crate::TRACKS`]) of a world of the
/// room, `samples` a pixel and half, of Mitsuba's or Blender's flavour.
pub fn ours(
    room: &Room,
    world: &World,
    scored: &ResultFile,
    track: usize,
    flavour: PrincipledFlavour,
    samples: u32,
) -> Pair {
    let staged;
    let (world, mix): (&World, LightMix) = match (track, room.is_staged()) {
        (0, _) => (world, vec![[1.0; 3]; world.emitters().groups()]),
        (_, false) => (world, radiances(room, scored)),
        (_, true) => {
            let quads: Vec<StageLight> = room.stage().into_iter().map(|named| named.light).collect();
            staged = world.on_stage(&quads).unwrap();
            (&staged, radiances(room, scored))
        }
    };
    let coat = |material: &mateval_submission::prediction::PredictedMaterial| Coat {
        base_colors: vec![material.base_color.clone()],
        roughness: material.roughness.clone(),
        metallic: material.metallic.clone(),
    };
    let coats = room.predicted.materials.iter().map(|material| material.as_ref().map(coat)).collect();
    let repaint = Repaint::new(world, &room.atlases, coats, flavour).unwrap();
    let settings = room.protocol.light.settings(samples);
    let mixes = vec![vec![mix]];
    let lighting = Lighting::Mixed(&mixes);
    let quiet = |_: usize, _: usize| ();
    let render = render_repainted(world, &repaint, 0..1, &room.cameras(), lighting, &settings, &[1, 2], &quiet);
    let views = render.unwrap().remove(0).views;
    [0, 1].map(|half| views.iter().map(|view| view.halves[half].basis.pictures()[0].clone()).collect())
}

/// The pixels whose noise is compared: valid ones; under the room's own lights without those that show a lamp which
/// Mitsuba cannot hide.
pub fn masks(room: &Room, track: usize) -> Vec<Mask> {
    let hidden: Vec<u16> =
        room.hidden_lights().into_iter().map(|surface| room.scene.instances[surface].index.0.get()).collect();
    let counts = |truth: &mateval_eval::truth::ViewTruth, x, y| {
        truth.valid.get(x, y) && !(track == 0 && hidden.contains(&truth.instances.get(x, y)))
    };
    let mask = |truth| Mask::from_fn(truth_size(truth)[0], truth_size(truth)[1], |x, y| counts(truth, x, y));
    room.truths.iter().map(mask).collect()
}

fn truth_size(truth: &mateval_eval::truth::ViewTruth) -> [usize; 2] {
    [truth.valid.width(), truth.valid.height()]
}

/// The noise of pictures of `samples` a pixel each.
pub fn noise(room: &Room, pair: &Pair, masks: &[Mask], samples: u32) -> TrackNoise {
    let samples = f64::from(samples);
    let [a, b] = [0, 1].map(|k| flat(&pair[k], masks, room.scene.exposure as f32));
    // A pair counts as pictures of twice the samples.
    let certified = certified(room, pair, masks).powi(2) * 2.0 * samples;
    TrackNoise { variance: Noise::of(&a, &b).srgb * samples, certified }
}

/// The standard error of the mean PSNR of the pair's mean, in dB, by its own noise; `own_db` in a result.
fn certified(room: &Room, pair: &Pair, masks: &[Mask]) -> f64 {
    let views = noise_free(room, pair, masks);
    let (input, novel) = views.split_at(INPUT_VIEWS);
    let error = |views: &[NoiseFreeMse]| psnr_mean_error(&views.iter().collect::<Vec<_>>());
    [input, novel].into_iter().filter_map(error).map(|noise| noise.reference).fold(0.0, f64::max)
}

/// The pair's error without noise, for each view. The pair stands in the place of the reference, whose noise is estimated
/// from two halves; the error is the same either way.
fn noise_free(room: &Room, pair: &Pair, masks: &[Mask]) -> Vec<NoiseFreeMse> {
    let exposure = room.scene.exposure as f32;
    let blocks = noise_blocks(&room.protocol.light.noise, &room.cameras());
    let mse = |view: usize| {
        let [a, b] = [0, 1].map(|k| encoded(&pair[k][view], exposure));
        let [truth_a, truth_b] = [0, 1].map(|k| encoded(&room.light[view].halves[k], exposure));
        let half = |estimate: Picture<SrgbRgb>| NoisyHalf { noise: estimate.map(|_| SrgbRgb([0.0; 3])), estimate };
        let truth = NoisyRender { a: half(truth_a), b: half(truth_b), shared: None };
        noise_free_mse(&truth, Halves { a: &a, b: &b }, &masks[view], &blocks[view]).unwrap().unwrap()
    };
    (0..masks.len()).map(mse).collect()
}

/// The number of samples a pixel for which a plain mean PSNR, of noisy pictures, is off by at most the standard error
/// that `scored` certifies, in the input view and in the novel ones. The noise of `samples` is estimated from `pair`.
///
/// A plain MSE is too large by the variance of a pixel: the mean PSNR is too small by 10 / ln 10 times the mean of
/// variance over MSE, to first order. Both contain the noise of the truth; the noise of the plain MSE beside its bias
/// is not counted.
pub fn plain_samples(room: &Room, pair: &Pair, masks: &[Mask], samples: u32, scored: &ResultFile, track: usize) -> f64 {
    let exposure = room.scene.exposure as f32;
    let too_small = |view: usize, mse: &NoiseFreeMse| {
        let [a, b] = [0, 1].map(|k| flat(&pair[k][view..=view], &masks[view..=view], exposure));
        10.0 / LN_10 * Noise::of(&a, &b).srgb * f64::from(samples) / mse.mse
    };
    let by_view: Vec<f64> =
        noise_free(room, pair, masks).iter().enumerate().map(|(view, mse)| too_small(view, mse)).collect();
    let (input, novel) = by_view.split_at(INPUT_VIEWS);
    let noise = scored.protocols["mateval-2"].noise.values().next().unwrap();
    let needed = |(values, views): (&[f64], Views)| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        mean / noise[&psnr(track, views)].standard_error_db.unwrap()
    };
    [(input, Views::Input), (novel, Views::Novel)].map(needed).into_iter().fold(0.0, f64::max)
}

/// The picture as it is compared: times the exposure, clipped to 0..1 and sRGB-encoded.
fn encoded(picture: &Linear, exposure: f32) -> Picture<SrgbRgb> {
    picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v * exposure))).to_srgb()
}

/// The pixels of all views within their masks, one after another.
pub fn flat(views: &[Linear], masks: &[Mask], exposure: f32) -> Vec<f32> {
    let inside = |(view, mask): (&Linear, &Mask)| {
        let pixels = view.pixels().iter().zip(mask.pixels()).filter(|(_, inside)| **inside);
        pixels.flat_map(|(pixel, _)| pixel.0).map(|value| value * exposure).collect::<Vec<_>>()
    };
    views.iter().zip(masks).flat_map(inside).collect()
}
