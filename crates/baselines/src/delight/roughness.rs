//! The roughness of parts, inferred from their reflections.
//!
//! Every part is lit once more at each roughness of a ladder, with the radiances that were fitted, and given the one
//! base colour that fits it best. The roughness with which this comes nearest to the photo is chosen, if it comes
//! nearer than the usual one by a margin: most photos do not determine it.

use std::collections::BTreeMap;

use mateval_image::{Mask, Picture};
use mateval_scene::{Progress, Report};
use mateval_tracer::{PhotoCache, split_light};

use super::part_room::PartRoom;
use super::surfaces::{Surfaces, USUAL_ROUGHNESS, settings};
use crate::error::BaselineError;

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
pub(super) fn choose(
    room: &PartRoom,
    cache: &PhotoCache<'_>,
    surfaces: &Surfaces,
    weights: &[[f64; 3]],
    seed: u64,
    progress: Progress<'_>,
) -> Result<Vec<f32>, BaselineError> {
    let (width, height) = (room.photo.width(), room.photo.height());
    let wanted = Mask::from_fn(width, height, |x, y| x % STEP == 0 && y % STEP == 0 && room.valid.get(x, y));
    let misfits_at = |roughness: f32| -> Result<BTreeMap<u16, f64>, BaselineError> {
        let roughnesses = vec![roughness; surfaces.roughnesses.len()];
        let all = Surfaces { colors: surfaces.colors.clone(), roughnesses, metals: surfaces.metals.clone() };
        let step = format!("roughness {roughness}");
        let split =
            split_light(&room.world, cache, &wanted, all.assumed(), &settings(SAMPLES, seed), &|done, total| {
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
