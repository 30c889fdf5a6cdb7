//! How well the base colour of each pixel is known, and what is taken where it is not.

use mateval_image::{LinearRgb, Picture};

use super::part_room::PartRoom;
use super::round_light::{LEAST_SHADING, LightHalves, RoundLight, mean};

/// The standard error of base colour at which confidence is one half.
pub(super) const DOUBTFUL_ERROR: f32 = 0.05;
/// The error of modelled light, as a share of the photo, and as a share of what is mirrored.
const MODEL_ERROR: f64 = 0.02;
const GLOSS_ERROR: f64 = 0.15;
/// The usual deviation of a pixel's colour from that of its part.
const PART_DEVIATION: f32 = 0.15;

/// The standard error of each pixel's base colour: from noise, estimated from the difference of both halves, and from
/// what the model of the light leaves out. Infinite where nothing is known.
pub(super) fn standard_errors(room: &PartRoom, halves: &LightHalves, light: &RoundLight) -> Picture<f32> {
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

/// Moves uncertain base colours towards the colour of their part: to the most likely ones, if the colours of a part
/// deviate from its own by [`PART_DEVIATION`].
pub(super) fn towards_parts(
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
