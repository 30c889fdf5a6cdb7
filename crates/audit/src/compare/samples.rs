//! How many samples the built-in tracer takes: as few as leave the decision to Blender's noise or to the bound.
//!
//! A pilot of few samples measures our noise in each tile. It falls in proportion to the number of samples.

use mateval_scene::json;
use mateval_scene::render_file::{RENDER_FILE, RenderFile};

use super::bounds::STANDARD_ERRORS;
use super::light::ShownKinds;
use super::ours::OurLight;
use super::theirs::TheirView;
use super::tiles::{Halves, Tile, median};
use crate::error::AuditError;

/// Samples per pixel of each half of the pilot, and the least number that is chosen.
pub(super) const PILOT: u32 = 8;

/// Where three of our standard errors are below this share of the bound, fewer of them would decide nothing.
const SHARE_OF_BOUND: f64 = 0.5;

/// The largest number of samples that Blender has rendered any of the views with.
pub(super) fn theirs(views: &[TheirView]) -> Result<u32, AuditError> {
    let mut most = 1;
    for view in views {
        let render: RenderFile = json::read(&view.folder.join(RENDER_FILE))?;
        most = most.max(render.samples_each_half);
    }
    Ok(most)
}

/// The number of samples at which the pictures of a view are noisy enough for its comparison, from its pilot. A picture of
/// Blender's that cannot be read asks for none; its check reports it.
pub(super) fn wanted(pilot: &OurLight, theirs: &TheirView, shown: &ShownKinds, bound: f64) -> u32 {
    let groups = pilot.groups.iter().enumerate().map(|(at, group)| (format!("group_{at:02}"), group));
    let pictures = std::iter::once(("rgb".to_owned(), &pilot.rgb)).chain(groups);
    let of_picture = |(name, ours): (String, &Halves)| {
        let theirs = theirs.halves(&name).ok()?;
        ratio([ours, &theirs], shown, bound)
    };
    let most = pictures.filter_map(of_picture).fold(0.0, f64::max);
    (f64::from(PILOT) * most).ceil() as u32
}

/// By how much our variance exceeds what is allowed, in the median tile; none where no tile decides. Allowed is Blender's own
/// variance, or that at which [`SHARE_OF_BOUND`] is met.
fn ratio([ours, theirs]: [&Halves; 2], shown: &ShownKinds, bound: f64) -> Option<f64> {
    let scale = ours.means(shown.counted());
    let of_tile = |tile: &Tile| {
        let [own, other] = [ours, theirs].map(|halves| halves.variance(tile.pixels()));
        let ratio = |c: usize| {
            let allowed = other[c].max((SHARE_OF_BOUND * bound * scale[c] / STANDARD_ERRORS).powi(2));
            if allowed > 0.0 { own[c] / allowed } else { 0.0 }
        };
        (0..3).map(ratio).fold(0.0, f64::max)
    };
    median(shown.all().filter(|(_, decides)| *decides).map(|(tile, _)| of_tile(tile)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use mateval_image::{LinearRgb, Mask, Picture};

    use super::super::kind::MaterialKind;

    /// Halves of a grey picture that differ by this much in each pixel.
    fn halves(apart: f32) -> Halves {
        let half =
            |sign: f32| Picture::from_fn(32, 32, |x, _| LinearRgb([0.5 + sign * apart * (-1_f32).powi(x as i32); 3]));
        Halves { a: half(0.5), b: half(-0.5) }
    }

    #[test]
    fn samples_follow_the_larger_of_their_noise_and_the_bound() {
        let shown = ShownKinds::new(&Picture::filled(32, 32, 1), &[MaterialKind::Lambert], &Mask::filled(32, 32, true));
        let ratio = |ours: f32, theirs: f32| ratio([&halves(ours), &halves(theirs)], &shown, 0.01).unwrap();
        // As noisy as theirs.
        assert!((ratio(0.4, 0.4) - 1.0).abs() < 1e-4);
        // Twice and half the noise: four times and a quarter of the samples.
        assert!((ratio(0.4, 0.2) - 4.0).abs() < 1e-3);
        assert!((ratio(0.2, 0.4) - 0.25).abs() < 1e-4);
        // Without noise of theirs: three standard errors of 16 * 16 pixels, each off by 0.1 / 2, against 0.5 * 0.01 * 0.5.
        let errors: f64 = 3.0 * (0.1 / 2.0) / 16.0;
        let expected = (errors / 0.0025).powi(2);
        assert!((ratio(0.1, 0.0) / expected - 1.0).abs() < 1e-3);
        assert_eq!(ratio(0.0, 0.0), 0.0);
    }
}
