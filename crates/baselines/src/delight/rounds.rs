//! The rounds of splitting, fitting and dividing.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Picture};
use mateval_light::joint_fit::{JointFit, JointFitRules, JointTarget, fit_jointly};
use mateval_scene::{Progress, Report};
use mateval_tracer::{PhotoCache, SplitLight, split_light};

use super::certainty::{DOUBTFUL_ERROR, standard_errors, towards_parts};
use super::delit_photo::DelitPhoto;
use super::mirrors::{self, Mirror};
use super::options::DelightOptions;
use super::part_room::PartRoom;
use super::possible_light::FittedLight;
use super::roughness;
use super::round_light::{RoundLight, fitted_light, weighted};
use super::surfaces::{Surfaces, USUAL_ROUGHNESS, part_colors, settings};
use crate::error::BaselineError;
use crate::geometry::SceneGeometry;

/// The change of a part's colour below which it is settled.
const SETTLED: f32 = 0.01;

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
    let mut surfaces = Surfaces::unknown(room.owners.len());
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
        let fit = fit(room, &halves, &options.fit);
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
        let is_last = (round >= options.samples.len() && change <= SETTLED) || round >= options.most_rounds;
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
    light: RoundLight,
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
        photo: room.photo.clone(),
        valid: room.valid.clone(),
        shading: light.diffuse,
        gloss: light.gloss,
        confidence: errors.map(|error| 1.0 / (1.0 + (error / DOUBTFUL_ERROR).powi(2))),
        lights: room
            .lights
            .iter()
            .zip(&fit.radiances)
            .map(|(light, radiance)| FittedLight { light: light.clone(), radiance: *radiance })
            .collect(),
        rounds,
    }
}

fn fit(room: &PartRoom, halves: &[SplitLight; 2], rules: &JointFitRules) -> JointFit {
    let target =
        JointTarget { photo: &room.photo, valid: &room.valid, parts: &room.parts, light: halves, shown: &room.shown };
    fit_jointly(rules, &target)
}

/// The weights of a basis: the radiances, and 1 for what the photo lights.
fn weights(fit: &JointFit) -> Vec<[f64; 3]> {
    fit.radiances.iter().copied().chain([[1.0; 3]]).collect()
}

fn largest_change(before: &[[f32; 3]], after: &[[f32; 3]]) -> f32 {
    let changes = before.iter().flatten().zip(after.iter().flatten()).map(|(a, b)| (a - b).abs());
    changes.fold(0.0, f32::max)
}
