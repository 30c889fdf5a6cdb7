//! The rounds of splitting, fitting and dividing.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Picture};
use mateval_light::joint_fit::{JointFit, JointFitRules, JointTarget, fit_jointly};
use mateval_scene::{Progress, Report};
use mateval_tracer::noise_filter::{self, filtered_mean};
use mateval_tracer::{PhotoCache, SplitLight, split_light};

use super::delit_photo::DelitPhoto;
use super::mirrors::{self, Mirror};
use super::options::DelightOptions;
use super::part_room::{NO_PART, PartRoom};
use super::roughness;
use super::surfaces::{Surfaces, USUAL_ROUGHNESS, settings};
use crate::error::BaselineError;
use crate::geometry::SceneGeometry;

/// The colour of parts before anything is known of them, linear.
const USUAL_COLOR: f32 = 0.45;
/// The largest number of rounds.
const MOST_ROUNDS: usize = 4;
/// The change of a part's colour below which it is settled.
const SETTLED: f32 = 0.01;
/// The least shading, as a share of the photo's mean, that the photo is divided by.
const LEAST_SHADING: f32 = 1e-3;
/// The standard error of base colour at which confidence is one half.
const DOUBTFUL_ERROR: f32 = 0.05;
/// The error of modelled light, as a share of the photo, and as a share of what is mirrored.
const MODEL_ERROR: f64 = 0.02;
const GLOSS_ERROR: f64 = 0.15;
/// The usual deviation of a pixel's colour from that of its part.
const PART_DEVIATION: f32 = 0.15;

/// Two independent halves of the light under fitted radiances: what a white surface would show, and what does not
/// depend on colour.
struct LightHalves {
    diffuse: [Picture<LinearRgb>; 2],
    gloss: [Picture<LinearRgb>; 2],
}

/// Their means, without noise, and the base colour that the photo has under this light.
struct FittedLight {
    diffuse: Picture<LinearRgb>,
    gloss: Picture<LinearRgb>,
    base_color: Picture<LinearRgb>,
}

/// De-lights the photo of a scene. Fails where the public files of the scene or its photo cannot be read. The bytes are
/// the same on any number of threads.
pub fn delight(
    geometry: &SceneGeometry<'_>,
    options: &DelightOptions,
    progress: Progress<'_>,
) -> Result<DelitPhoto, BaselineError> {
    let room = PartRoom::read(geometry, options.lights)?;
    run(&room, options, progress)
}

pub(super) fn run(
    room: &PartRoom,
    options: &DelightOptions,
    progress: Progress<'_>,
) -> Result<DelitPhoto, BaselineError> {
    let nothing = room.valid.map(|_| false);
    let cached = if options.photo_cache { &room.valid } else { &nothing };
    let cache = PhotoCache::new(&room.world, &room.camera, &room.photo, cached)?;
    let count = room.owners.len();
    let mut surfaces = Surfaces { colors: vec![[USUAL_COLOR; 3]; count], roughnesses: vec![USUAL_ROUGHNESS; count] };
    let mut round = 0;
    loop {
        let samples = options.samples[round.min(options.samples.len() - 1)];
        // Two independent halves, whose difference is the noise. The same paths in every round, so that a change is
        // none of noise.
        let half = |half: u64| {
            let settings = settings((samples / 2).max(1), options.seed.wrapping_add(half));
            let step = format!("round {}, half {}", round + 1, ["a", "b"][half as usize]);
            split_light(&room.world, &cache, &room.valid, surfaces.assumed(), &settings, &|done, total| {
                progress(Report::step(&step, done, total));
            })
        };
        let halves = [half(0)?, half(1)?];
        let fit = fit(room, &halves);
        let weights = weights(&fit);
        let halves = weighted(&halves, &weights)?;
        let light = fitted_light(room, &halves);
        let found = part_colors(room, &light.base_color);
        let change = largest_change(&surfaces.colors, &found);
        surfaces.colors = found;
        round += 1;
        if round < options.samples.len() {
            surfaces.roughnesses = roughness::choose(room, &cache, &surfaces, &weights, options.seed, progress)?;
        }
        let is_last = (round >= options.samples.len() && change <= SETTLED) || round == MOST_ROUNDS;
        if is_last {
            let errors = standard_errors(room, &halves, &light);
            let mirrors = mirrors::find(room, &cache);
            return Ok(finished(room, &fit, light, &errors, &surfaces, &mirrors, round));
        }
    }
}

/// The pictures of the last round.
fn finished(
    room: &PartRoom,
    fit: &JointFit,
    light: FittedLight,
    errors: &Picture<f32>,
    surfaces: &Surfaces,
    mirrors: &BTreeMap<u16, Mirror>,
    rounds: usize,
) -> DelitPhoto {
    let base_color = towards_parts(room, &light.base_color, &surfaces.colors, errors);
    let part = |x: usize, y: usize| room.valid.get(x, y).then(|| room.parts.get(x, y));
    let mirror = |x: usize, y: usize| part(x, y).and_then(|part| mirrors.get(&part));
    let (width, height) = (room.photo.width(), room.photo.height());
    DelitPhoto {
        base_color: Picture::from_fn(width, height, |x, y| {
            mirror(x, y).map_or(base_color.get(x, y), |mirror| LinearRgb(mirror.base_color))
        }),
        roughness: Picture::from_fn(width, height, |x, y| {
            let own = part(x, y).map_or(USUAL_ROUGHNESS, |part| surfaces.roughnesses[usize::from(part)]);
            mirror(x, y).map_or(own, |mirror| mirror.roughness)
        }),
        metallic: Picture::from_fn(width, height, |x, y| mirror(x, y).map_or(0.0, |_| 1.0)),
        valid: room.valid.clone(),
        shading: light.diffuse,
        gloss: light.gloss,
        confidence: errors.map(|error| 1.0 / (1.0 + (error / DOUBTFUL_ERROR).powi(2))),
        radiances: room.lights.iter().cloned().zip(fit.radiances.iter().copied()).collect(),
        rounds,
    }
}

fn fit(room: &PartRoom, halves: &[SplitLight; 2]) -> JointFit {
    let target =
        JointTarget { photo: &room.photo, valid: &room.valid, parts: &room.parts, light: halves, shown: &room.shown };
    fit_jointly(&JointFitRules::default(), &target)
}

/// The weights of a basis: the radiances, and 1 for what the photo lights.
fn weights(fit: &JointFit) -> Vec<[f64; 3]> {
    fit.radiances.iter().copied().chain([[1.0; 3]]).collect()
}

fn weighted(halves: &[SplitLight; 2], weights: &[[f64; 3]]) -> Result<LightHalves, BaselineError> {
    let [a, b] = halves;
    Ok(LightHalves {
        diffuse: [a.diffuse.weighted(weights)?, b.diffuse.weighted(weights)?],
        gloss: [a.gloss.weighted(weights)?, b.gloss.weighted(weights)?],
    })
}

fn fitted_light(room: &PartRoom, halves: &LightHalves) -> FittedLight {
    let white = room.photo.map(|_| LinearRgb([1.0; 3]));
    let surfaces = noise_filter::Surfaces {
        base_color: &white,
        instances: &room.parts,
        normals: &room.normals,
        valid: &room.valid,
    };
    let filtered = |[a, b]: &[Picture<LinearRgb>; 2]| filtered_mean([a, b], &surfaces);
    let (diffuse, gloss) = (filtered(&halves.diffuse), filtered(&halves.gloss));
    let base_color = divided(room, &diffuse, &gloss);
    FittedLight { diffuse, gloss, base_color }
}

/// The photo without its light.
fn divided(room: &PartRoom, diffuse: &Picture<LinearRgb>, gloss: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    let least = LEAST_SHADING * mean(room);
    Picture::from_fn(room.photo.width(), room.photo.height(), |x, y| {
        if !room.valid.get(x, y) {
            return LinearRgb::default();
        }
        let [photo, diffuse, gloss] = [&room.photo, diffuse, gloss].map(|picture| picture.get(x, y).0);
        LinearRgb([0, 1, 2].map(|c| ((photo[c] - gloss[c]) / diffuse[c].max(least)).clamp(0.0, 1.0)))
    })
}

/// The mean luminance of the photo's valid pixels, above 0.
fn mean(room: &PartRoom) -> f32 {
    /// Below it, squares of radiances would vanish in the numbers' precision.
    const LEAST: f64 = 1e-12;
    let valid = { room.photo.pixels().iter().zip(room.valid.pixels()) }.filter(|(_, valid)| **valid);
    let (sum, count) = valid.fold((0.0, 0.0), |(sum, count), (pixel, _)| (sum + pixel.luminance(), count + 1.0));
    (sum / f64::max(count, 1.0)).clamp(LEAST, f64::from(f32::MAX)) as f32
}

/// The colour of each surface: the median of its pixels. One that is not seen takes the median of those of its
/// instance, else the mean grey of all that are seen.
fn part_colors(room: &PartRoom, base_color: &Picture<LinearRgb>) -> Vec<[f32; 3]> {
    let mut of_part: BTreeMap<usize, Vec<[f32; 3]>> = BTreeMap::new();
    let mut of_owner: BTreeMap<usize, Vec<[f32; 3]>> = BTreeMap::new();
    for ((part, color), _) in
        { room.parts.pixels().iter().zip(base_color.pixels()) }.zip(room.valid.pixels()).filter(|(_, valid)| **valid)
    {
        debug_assert!(*part != NO_PART, "valid pixels have a part");
        of_part.entry(usize::from(*part)).or_default().push(color.0);
        of_owner.entry(room.owners[usize::from(*part)]).or_default().push(color.0);
    }
    let medians = |all: BTreeMap<usize, Vec<[f32; 3]>>| -> BTreeMap<usize, [f32; 3]> {
        all.into_iter().map(|(at, mut colors)| (at, median(&mut colors))).collect()
    };
    let (of_part, of_owner) = (medians(of_part), medians(of_owner));
    let grey = match of_part.len() {
        0 => USUAL_COLOR,
        seen => of_part.values().flatten().sum::<f32>() / (3 * seen) as f32,
    };
    let color = |(surface, owner)| of_part.get(&surface).or(of_owner.get(owner)).copied().unwrap_or([grey; 3]);
    room.owners.iter().enumerate().map(color).collect()
}

fn median(colors: &mut [[f32; 3]]) -> [f32; 3] {
    let middle = colors.len() / 2;
    [0, 1, 2].map(|channel| {
        let (_, value, _) = colors.select_nth_unstable_by(middle, |a, b| a[channel].total_cmp(&b[channel]));
        value[channel]
    })
}

fn largest_change(before: &[[f32; 3]], after: &[[f32; 3]]) -> f32 {
    let changes = before.iter().flatten().zip(after.iter().flatten()).map(|(a, b)| (a - b).abs());
    changes.fold(0.0, f32::max)
}

/// The standard error of each pixel's base colour: from noise, estimated from the difference of both halves, and from
/// what the model of the light leaves out. Infinite where nothing is known.
fn standard_errors(room: &PartRoom, halves: &LightHalves, light: &FittedLight) -> Picture<f32> {
    /// Pixels on each side that the noise is averaged over.
    const REACH: usize = 2;
    let least = f64::from(LEAST_SHADING * mean(room));
    let halved = |[a, b]: &[Picture<LinearRgb>; 2], x, y| 0.5 * (a.get(x, y).luminance() - b.get(x, y).luminance());
    // Squares of the error, in f64: those of f32 vanish in dark photos.
    let noise = |x: usize, y: usize| {
        let shading = light.diffuse.get(x, y).luminance().max(least);
        let color = (room.photo.get(x, y).luminance() / shading).min(1.0);
        let difference = color * halved(&halves.diffuse, x, y) + halved(&halves.gloss, x, y);
        (difference / shading).powi(2)
    };
    let (width, height) = (room.photo.width(), room.photo.height());
    Picture::from_fn(width, height, |x, y| {
        if !room.valid.get(x, y) {
            return f32::INFINITY;
        }
        let columns = x.saturating_sub(REACH)..(x + REACH + 1).min(width);
        let (mut sum, mut count) = (0.0, 0.0);
        for row in y.saturating_sub(REACH)..(y + REACH + 1).min(height) {
            for column in columns.clone().filter(|&column| room.valid.get(column, row)) {
                sum += noise(column, row);
                count += 1.0;
            }
        }
        let [photo, shading, gloss] =
            [&room.photo, &light.diffuse, &light.gloss].map(|picture| picture.get(x, y).luminance());
        let model = (MODEL_ERROR * photo).powi(2) + (GLOSS_ERROR * gloss).powi(2);
        (sum / count + model / shading.max(least).powi(2)).sqrt() as f32
    })
}

/// Base colours that are not well known nearer to the colour of their part: the most likely ones, if the colours of a
/// part deviate from its own by [`PART_DEVIATION`].
fn towards_parts(
    room: &PartRoom,
    base_color: &Picture<LinearRgb>,
    parts: &[[f32; 3]],
    errors: &Picture<f32>,
) -> Picture<LinearRgb> {
    Picture::from_fn(room.photo.width(), room.photo.height(), |x, y| {
        if !room.valid.get(x, y) {
            return LinearRgb::default();
        }
        let (own, part) = (base_color.get(x, y).0, parts[usize::from(room.parts.get(x, y))]);
        // The share of what the pixel itself shows; no product of infinities.
        let share = 1.0 / (1.0 + (errors.get(x, y) / PART_DEVIATION).powi(2));
        LinearRgb([0, 1, 2].map(|c| share * own[c] + (1.0 - share) * part[c]))
    })
}
