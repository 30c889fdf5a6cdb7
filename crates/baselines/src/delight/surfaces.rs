//! What is assumed of surfaces while light is split: the colour of parts, and their roughness, inferred from their
//! reflections.
//!
//! Every part is lit once more at each roughness of a ladder, with the radiances that were fitted, and given the one
//! base colour that fits it best. The roughness with which this comes nearest to the photo is chosen, if it comes
//! nearer than the usual one by a margin: most photos do not determine it.

use std::collections::BTreeMap;

use mateval_dataset::{Progress, Report};
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_tracer::{AssumedSurfaces, PhotoCache, RenderSettings, split_light};

use super::room::{NO_PART, PartRoom};
use crate::error::BaselineError;

/// The colour of parts before anything is known of them, linear.
const USUAL_COLOR: f32 = 0.45;

/// The perceptual roughness of surfaces of which nothing is known: the format's default.
pub(super) const USUAL_ROUGHNESS: f32 = 0.5;
/// Scatterings after which a path ends: the light of longer ones depends on assumed colours most.
const MOST_BOUNCES: u32 = 8;

/// What is known of the surfaces of the room.
pub(super) struct Surfaces {
    /// The linear base colour of each.
    pub(super) colors: Vec<[f32; 3]>,
    /// The perceptual roughness of each.
    pub(super) roughnesses: Vec<f32>,
}

impl Surfaces {
    /// `count` surfaces of which nothing is known.
    pub(super) fn unknown(count: usize) -> Self {
        Self { colors: vec![[USUAL_COLOR; 3]; count], roughnesses: vec![USUAL_ROUGHNESS; count] }
    }

    pub(super) fn assumed(&self) -> AssumedSurfaces<'_> {
        AssumedSurfaces { colors: &self.colors, roughnesses: &self.roughnesses }
    }
}

/// The settings of a pass.
pub(super) fn settings(samples: u32, seed: u64) -> RenderSettings {
    RenderSettings { samples, seed, max_bounces: MOST_BOUNCES, ..RenderSettings::default() }
}

/// The colour of each surface: the median of its pixels. One that is not seen takes the median of those of its
/// instance, else the mean grey of all that are seen.
pub(super) fn part_colors(room: &PartRoom, base_color: &Picture<LinearRgb>) -> Vec<[f32; 3]> {
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
        all.into_iter().map(|(at, mut colors)| (at, upper_median(&mut colors))).collect()
    };
    let (of_part, of_owner) = (medians(of_part), medians(of_owner));
    let grey = match of_part.len() {
        0 => USUAL_COLOR,
        seen => of_part.values().flatten().sum::<f32>() / (3 * seen) as f32,
    };
    let color = |(surface, owner)| of_part.get(&surface).or(of_owner.get(owner)).copied().unwrap_or([grey; 3]);
    room.owners.iter().enumerate().map(color).collect()
}

/// The median of each channel; of an even number of colours the higher of the middle two.
pub(super) fn upper_median(colors: &mut [[f32; 3]]) -> [f32; 3] {
    let middle = colors.len() / 2;
    [0, 1, 2].map(|channel| {
        let (_, value, _) = colors.select_nth_unstable_by(middle, |a, b| a[channel].total_cmp(&b[channel]));
        value[channel]
    })
}

/// Perceptual roughness values that are tried beside the usual one.
const LADDER: [f32; 5] = [0.1, 0.2, 0.35, 0.7, 0.9];
/// Paths per pixel of each.
const SAMPLES: u32 = 8;
/// Only one pixel in each square of this side is traced.
const STEP: usize = 2;
/// Side of the squares, in pixels, over which light and photo are averaged.
const POOL: usize = 8;
/// The least number of squares of a part.
const LEAST_SQUARES: usize = 10;
/// Another roughness is chosen if its misfit is at most this share of the usual one's, and smaller by at least this
/// much.
const MOST_MISFIT: f64 = 0.9;
const LEAST_GAIN: f64 = 0.04;

/// The roughness of each surface. `weights` are those of the lights, and of the photo's own light.
pub(super) fn choose_roughness(
    room: &PartRoom,
    cache: &PhotoCache<'_>,
    surfaces: &Surfaces,
    weights: &[[f64; 3]],
    progress: Progress<'_>,
) -> Result<Vec<f32>, BaselineError> {
    let (width, height) = (room.photo.width(), room.photo.height());
    let wanted = Mask::from_fn(width, height, |x, y| x % STEP == 0 && y % STEP == 0 && room.valid.get(x, y));
    let misfits_at = |roughness: f32| -> Result<BTreeMap<u16, f64>, BaselineError> {
        let roughnesses = vec![roughness; surfaces.roughnesses.len()];
        let assumed = AssumedSurfaces { roughnesses: &roughnesses, ..surfaces.assumed() };
        let step = format!("roughness {roughness}");
        let split = split_light(&room.world, cache, &wanted, assumed, &settings(SAMPLES, 0), &|done, total| {
            progress(Report::step(&step, done, total));
        })?;
        let [diffuse, gloss] =
            [split.diffuse.weighted(weights)?, split.gloss.weighted(weights)?].map(|p| p.map(|v| v.luminance()));
        Ok(misfits(room, &wanted, &diffuse, &gloss))
    };
    let usual = misfits_at(USUAL_ROUGHNESS)?;
    let mut best: BTreeMap<u16, (f64, f32)> = usual
        .iter()
        .map(|(part, misfit)| (*part, ((MOST_MISFIT * misfit).min(misfit - LEAST_GAIN), USUAL_ROUGHNESS)))
        .collect();
    for roughness in LADDER {
        for (part, misfit) in misfits_at(roughness)? {
            if let Some(best) = best.get_mut(&part).filter(|best| misfit < best.0) {
                *best = (misfit, roughness);
            }
        }
    }
    let roughness = |surface: usize| {
        u16::try_from(surface)
            .ok()
            .and_then(|part| best.get(&part))
            .map_or(USUAL_ROUGHNESS, |(_, roughness)| *roughness)
    };
    Ok((0..surfaces.roughnesses.len()).map(roughness).collect())
}

/// For each part that is large enough, how far the photo is from a part of one base colour under this light: the mean
/// over squares, as a share of the photo.
fn misfits(room: &PartRoom, wanted: &Mask, diffuse: &Picture<f64>, gloss: &Picture<f64>) -> BTreeMap<u16, f64> {
    let width = room.photo.width();
    let mut sums: BTreeMap<(u16, usize), [f64; 3]> = BTreeMap::new();
    for (k, part) in room.parts.pixels().iter().enumerate().filter(|(k, _)| wanted.pixels()[*k]) {
        let square = k / width / POOL * width.div_ceil(POOL) + k % width / POOL;
        let sum = sums.entry((*part, square)).or_default();
        let values = [room.photo.pixels()[k].luminance(), diffuse.pixels()[k], gloss.pixels()[k]];
        sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
    }
    let mut of_part: BTreeMap<u16, Vec<[f64; 3]>> = BTreeMap::new();
    for ((part, _), square) in sums {
        let [photo, diffuse, _] = square;
        if photo > 0.0 && diffuse > 0.0 {
            of_part.entry(part).or_default().push(square);
        }
    }
    of_part.retain(|_, squares| squares.len() >= LEAST_SQUARES);
    let misfit = |(part, squares): (u16, Vec<[f64; 3]>)| {
        let mut colors: Vec<f64> = squares.iter().map(|[photo, diffuse, gloss]| (photo - gloss) / diffuse).collect();
        let middle = colors.len() / 2;
        let color = colors.select_nth_unstable_by(middle, f64::total_cmp).1.clamp(0.0, 1.0);
        let misfit = |[photo, diffuse, gloss]: &[f64; 3]| ((photo - color * diffuse - gloss) / photo).abs().min(1.0);
        (part, squares.iter().map(misfit).sum::<f64>() / squares.len() as f64)
    };
    of_part.into_iter().map(misfit).collect()
}
