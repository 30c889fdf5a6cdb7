//! The light of one round under the radiances that were fitted, and the base colour that remains of the photo.

use mateval_image::{LinearRgb, Picture};
use mateval_tracer::SplitLight;
use mateval_tracer::noise_filter::{self, filtered_mean};

use super::part_room::PartRoom;
use crate::error::BaselineError;

/// The least shading, as a share of the photo's mean, that the photo is divided by.
pub(super) const LEAST_SHADING: f32 = 1e-3;

/// Two independent halves of the light under fitted radiances: what a white surface would show, and what does not
/// depend on colour.
pub(super) struct LightHalves {
    pub(super) diffuse: [Picture<LinearRgb>; 2],
    pub(super) gloss: [Picture<LinearRgb>; 2],
}

/// Their means, without noise, and the base colour that the photo has under this light.
pub(super) struct RoundLight {
    pub(super) diffuse: Picture<LinearRgb>,
    pub(super) gloss: Picture<LinearRgb>,
    pub(super) base_color: Picture<LinearRgb>,
}

/// The light of all lights, each with its weight.
pub(super) fn weighted(halves: &[SplitLight; 2], weights: &[[f64; 3]]) -> Result<LightHalves, BaselineError> {
    let [a, b] = halves;
    Ok(LightHalves {
        diffuse: [a.diffuse.weighted(weights)?, b.diffuse.weighted(weights)?],
        gloss: [a.gloss.weighted(weights)?, b.gloss.weighted(weights)?],
    })
}

/// The light without noise, and the photo divided by it.
pub(super) fn fitted_light(room: &PartRoom, halves: &LightHalves) -> RoundLight {
    let (diffuse, gloss) = (filtered(room, &halves.diffuse), filtered(room, &halves.gloss));
    let base_color = divided(room, &diffuse, &gloss);
    RoundLight { diffuse, gloss, base_color }
}

/// The mean of two halves of light that does not depend on base colour, without its noise.
pub(super) fn filtered(room: &PartRoom, [a, b]: &[Picture<LinearRgb>; 2]) -> Picture<LinearRgb> {
    let surfaces =
        noise_filter::Surfaces { base_color: None, instances: &room.parts, normals: &room.normals, valid: &room.valid };
    filtered_mean([a, b], &surfaces)
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
pub(super) fn mean(room: &PartRoom) -> f32 {
    /// Below it, squares of radiances would vanish in the numbers' precision.
    const LEAST: f64 = 1e-12;
    let valid = { room.photo.pixels().iter().zip(room.valid.pixels()) }.filter(|(_, valid)| **valid);
    let (sum, count) = valid.fold((0.0, 0.0), |(sum, count), (pixel, _)| (sum + pixel.luminance(), count + 1.0));
    (sum / f64::max(count, 1.0)).clamp(LEAST, f64::from(f32::MAX)) as f32
}
