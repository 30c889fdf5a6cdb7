//! The pictures of a room, one for each of its lights.

use mateval_image::{LinearRgb, Picture};
use mateval_scene::{Progress, Report};
use mateval_tracer::{PhotoCache, SplitLight, split_light};

use super::super::part_room::PartRoom;
use super::super::round_light::{filtered, weighted};
use super::super::surfaces::settings;
use super::delit_pictures::DelitPictures;
use crate::error::BaselineError;

/// The number of lights that get a picture of their own.
const MOST_PICTURES: usize = 8;

/// A light's share of the picture.
pub(super) struct LitPicture {
    /// The light's place in `lights.json`.
    pub(super) light: usize,
    /// Linear radiance, before exposure.
    pub(super) picture: Picture<LinearRgb>,
}

/// A room under its lights.
pub(super) struct RelitPhoto {
    /// The lights that bring most to the valid pixels, as they were fitted; the strongest first.
    pub(super) strongest: Vec<LitPicture>,
    /// The sum of the other lights, each times its factor, and the photo where a pixel shows neither a known surface nor
    /// a light's emission, such as glass.
    pub(super) rest: Picture<LinearRgb>,
    /// The room with each light times its factor.
    pub(super) whole: Picture<LinearRgb>,
}

/// Lights the room anew. `factors` holds one factor for each light. Fails if `delit` does not belong to the room.
pub(super) fn relight(
    room: &PartRoom,
    delit: &DelitPictures,
    factors: &[f64],
    samples: u32,
    progress: Progress<'_>,
) -> Result<RelitPhoto, BaselineError> {
    delit.check(room)?;
    let lit = LitRoom { room, base_color: &delit.base_color, halves: halves(room, delit, samples, progress)? };
    let fitted: Vec<[f64; 3]> = delit.lights.lights.iter().map(|light| light.radiance).collect();
    // Find the lights that bring most.
    let mut shares: Vec<(usize, f64)> =
        (0..fitted.len()).map(|light| (light, lit.share(light, fitted[light]))).collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    shares.retain(|(_, share)| *share > 0.0);
    let strongest: Vec<usize> = shares.iter().take(MOST_PICTURES).map(|(light, _)| *light).collect();
    // Draw each of them alone, the others together, and all of them dimmed.
    let picture_of = |shines: &dyn Fn(usize) -> f64| {
        let factors: Vec<f64> = (0..fitted.len()).map(shines).collect();
        lit.picture(&fitted, &factors)
    };
    let alone = |light: usize| picture_of(&|other| f64::from(u8::from(other == light)));
    let others = picture_of(&|light| if strongest.contains(&light) { 0.0 } else { factors[light] })?;
    let dimmed = picture_of(&|light| factors[light])?;
    let strongest = strongest.into_iter().map(|light| Ok(LitPicture { light, picture: alone(light)? }));
    let strongest = strongest.collect::<Result<_, BaselineError>>()?;
    Ok(RelitPhoto { strongest, rest: lit.with_unknown(&others), whole: lit.with_unknown(&dimmed) })
}

/// Two independent halves of the room's light, each light at radiance 1. Nothing is read from the photo.
fn halves(
    room: &PartRoom,
    delit: &DelitPictures,
    samples: u32,
    progress: Progress<'_>,
) -> Result<[SplitLight; 2], BaselineError> {
    let nothing = room.valid.map(|_| false);
    let cache = PhotoCache::new(&room.world, &room.camera, &room.photo, &nothing)?;
    let surfaces = delit.surfaces(room);
    let half = |seed: u64| {
        let settings = settings((samples / 2).max(1), seed);
        split_light(&room.world, &cache, &room.valid, surfaces.assumed(), &settings, &|done, total| {
            progress(Report::step(["light, half a", "light, half b"][seed as usize], done, total));
        })
    };
    Ok([half(0)?, half(1)?])
}

/// A room with its light and base colours.
struct LitRoom<'a> {
    room: &'a PartRoom,
    base_color: &'a Picture<LinearRgb>,
    halves: [SplitLight; 2],
}

impl LitRoom<'_> {
    /// The sum over pixels of the luminance that a light brings.
    fn share(&self, light: usize, radiance: [f64; 3]) -> f64 {
        let [half, _] = &self.halves;
        let [diffuse, gloss] = [&half.diffuse, &half.gloss].map(|basis| basis.pictures()[light].pixels());
        let lit = diffuse.iter().zip(gloss).zip(self.base_color.pixels());
        let brought = lit.map(|((diffuse, gloss), color)| {
            let by = |c: usize| radiance[c] as f32 * (color.0[c] * diffuse.0[c] + gloss.0[c]);
            LinearRgb([by(0), by(1), by(2)]).luminance()
        });
        brought.sum()
    }

    /// The room under lights of these radiances, each times its factor, and their glow where the photo shows it.
    fn picture(&self, radiances: &[[f64; 3]], factors: &[f64]) -> Result<Picture<LinearRgb>, BaselineError> {
        let room = self.room;
        let weights = radiances.iter().zip(factors).map(|(radiance, factor)| radiance.map(|v| v * factor));
        // The last picture is that of the photo as a light, of which there is none.
        let weights: Vec<[f64; 3]> = weights.chain([[0.0; 3]]).collect();
        let halves = weighted(&self.halves, &weights)?;
        let (diffuse, gloss) = (filtered(room, &halves.diffuse), filtered(room, &halves.gloss));
        Ok(Picture::from_fn(room.photo.width(), room.photo.height(), |x, y| {
            if room.valid.get(x, y) {
                let [color, diffuse, gloss] = [self.base_color, &diffuse, &gloss].map(|picture| picture.get(x, y).0);
                return LinearRgb([0, 1, 2].map(|c| (color[c] * diffuse[c] + gloss[c]).max(0.0)));
            }
            let factor = room.emission.get(x, y).map_or(0.0, |light| factors[light] as f32);
            LinearRgb(room.photo.get(x, y).0.map(|v| v * factor))
        }))
    }

    /// A picture of known pixels, completed by the photo.
    fn with_unknown(&self, known: &Picture<LinearRgb>) -> Picture<LinearRgb> {
        let room = self.room;
        Picture::from_fn(known.width(), known.height(), |x, y| {
            let is_known = room.valid.get(x, y) || room.emission.get(x, y).is_some();
            if is_known { known.get(x, y) } else { room.photo.get(x, y) }
        })
    }
}
