//! The two renderers' pictures: reads Blender's, decides how many samples ours take, and renders ours.
//!
//! Ours take as few samples as leave the decision to Blender's noise or to the bound. A pilot of few samples measures
//! our noise in each tile. It falls in proportion to the number of samples.

use std::path::{Path, PathBuf};

use crate::render::MAX_BOUNCES;
use mateval_dataset::dataset::View;
use mateval_dataset::render_file::{RENDER_FILE, RenderFile};
use mateval_dataset::{Camera, Progress, Report, SceneId, json};
use mateval_files::untrusted::sha256_of_bytes;
use mateval_image::{ImageError, LinearRgb, Picture, exr_io};
use mateval_tracer::{RenderSettings, ViewLight, World, render_views};

use super::file::{BOUNDS, Check, State, file_check};
use super::light::ShownKinds;
use super::tiles::{Halves, Tile, median};
use crate::error::PrepError;

/// The folder of Blender's pictures of a view.
#[derive(Clone, Debug)]
pub(super) struct TheirView {
    pub(super) folder: PathBuf,
    /// Width and height that every picture must have.
    pub(super) size: (usize, usize),
}

impl TheirView {
    /// Reads a picture. Fails with the check that reports why it could not be read. `picture` is its name without
    /// extension.
    pub(super) fn read<T: Copy>(
        &self,
        picture: &str,
        file: &str,
        read: impl FnOnce(&Path) -> Result<Picture<T>, ImageError>,
    ) -> Result<Picture<T>, Check> {
        let path = self.folder.join(file);
        if !path.exists() {
            return Err(file_check(picture, State::Missing, format!("'{file}' does not exist; render the view again")));
        }
        let unreadable = |what: String| file_check(picture, State::Unreadable, what);
        let found = read(&path).map_err(|error| unreadable(error.to_string()))?;
        let size = (found.width(), found.height());
        if size == self.size {
            return Ok(found);
        }
        let (expected, size) = (format!("{}x{}", self.size.0, self.size.1), format!("{}x{}", size.0, size.1));
        Err(unreadable(format!("'{file}' has {size} pixels, expected {expected}")))
    }

    /// Reads a picture of linear RGB.
    pub(super) fn linear(&self, picture: &str, file: &str) -> Result<Picture<LinearRgb>, Check> {
        self.read(picture, file, exr_io::read_linear)
    }

    /// Reads `<picture>_a.exr` and `<picture>_b.exr`.
    pub(super) fn halves(&self, picture: &str) -> Result<Halves, Check> {
        let [a, b] = ["a", "b"].map(|half| self.linear(picture, &format!("{picture}_{half}.exr")));
        Ok(Halves { a: a?, b: b? })
    }
}

/// The built-in tracer's pictures of one view.
pub(super) struct OurLight {
    /// Under all lights.
    pub(super) rgb: Halves,
    /// Under each light group alone, in the order of `lights.json`.
    pub(super) groups: Vec<Halves>,
}

/// The seeds of a scene's two halves. No other render of the scene uses them, so that the errors are independent.
pub(super) fn seeds(scene: &SceneId) -> [u64; 2] {
    ["a", "b"].map(|half| {
        let text = sha256_of_bytes(format!("compare/{scene}/{half}").as_bytes());
        u64::from_str_radix(&text[..16], 16).expect("a hash is hexadecimal")
    })
}

/// The most memory that the pictures of all lights may take at once: 138 lights in two halves of five views of 480 x 270
/// pixels.
const MOST_BYTES: u64 = 2 << 30;

/// Renders `views` of the scene: all from one set of paths where they share a centre and their pictures fit in memory,
/// otherwise one after the other.
pub(super) fn render_ours(
    world: &World,
    id: &SceneId,
    views: &[&View],
    samples: u32,
    progress: Progress<'_>,
) -> Result<Vec<OurLight>, PrepError> {
    let settings = RenderSettings { samples, max_bounces: MAX_BOUNCES, ..Default::default() };
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    let lights = world.scene().lights.len();
    let fit = |cameras: &[Camera]| {
        let pixels = |camera: &Camera| u64::from(camera.intrinsics.width) * u64::from(camera.intrinsics.height);
        let halves = 2 * cameras.iter().map(pixels).sum::<u64>() * size_of::<LinearRgb>() as u64;
        halves.saturating_mul(lights as u64) <= MOST_BYTES
    };
    let at_once = if fit(&cameras) { cameras.len().max(1) } else { 1 };
    let mut found = Vec::new();
    let passes = cameras.len().div_ceil(at_once);
    for (pass, cameras) in cameras.chunks(at_once).enumerate() {
        if !fit(cameras) {
            return Err(PrepError::TooManyLights { scene: id.clone(), lights, most_bytes: MOST_BYTES });
        }
        let step = format!("{id} ours");
        let shown = |done: usize, all: usize| progress(Report::step(&step, pass * all + done, passes * all));
        let rendered = render_views(world, cameras, &settings, &seeds(id), &shown)?;
        found.extend(rendered.views.iter().map(light_of));
    }
    Ok(found)
}

fn light_of(view: &ViewLight) -> OurLight {
    let [a, b] = [0, 1].map(|half| &view.halves[half]);
    let groups = a.pictures().iter().zip(b.pictures());
    let groups = groups.map(|(a, b)| Halves { a: a.clone(), b: b.clone() }).collect();
    OurLight { rgb: Halves { a: a.sum(), b: b.sum() }, groups }
}

/// Samples per pixel of each half of the pilot, and the least number that is chosen.
pub(super) const PILOT: u32 = 8;

/// Where three of our standard errors are below this share of the bound, fewer of them would decide nothing.
const SHARE_OF_BOUND: f64 = 0.5;

/// The largest number of samples that Blender has rendered any of the views with.
pub(super) fn most_samples(views: &[TheirView]) -> Result<u32, PrepError> {
    let mut most = 1;
    for view in views {
        let render: RenderFile = json::read(&view.folder.join(RENDER_FILE))?;
        most = most.max(render.samples_each_half);
    }
    Ok(most)
}

/// The number of samples at which the pictures of a view are noisy enough for its comparison, from its pilot. A picture
/// of Blender's that cannot be read asks for none; its check reports it.
pub(super) fn wanted_samples(pilot: &OurLight, theirs: &TheirView, shown: &ShownKinds, bound: f64) -> u32 {
    let groups = pilot.groups.iter().enumerate().map(|(at, group)| (format!("group_{at:02}"), group));
    let pictures = std::iter::once(("rgb".to_owned(), &pilot.rgb)).chain(groups);
    let of_picture = |(name, ours): (String, &Halves)| {
        let theirs = theirs.halves(&name).ok()?;
        ratio([ours, &theirs], shown, bound)
    };
    let most = pictures.filter_map(of_picture).fold(0.0, f64::max);
    (f64::from(PILOT) * most).ceil() as u32
}

/// By how much our variance exceeds what is allowed, in the median tile; absent if no tile decides. Allowed is
/// Blender's own variance, or that at which [`SHARE_OF_BOUND`] is met.
fn ratio([ours, theirs]: [&Halves; 2], shown: &ShownKinds, bound: f64) -> Option<f64> {
    let scale = ours.means(shown.counted());
    let of_tile = |tile: &Tile| {
        let [own, other] = [ours, theirs].map(|halves| halves.variance(tile.pixels()));
        let ratio = |c: usize| {
            let allowed = other[c].max((SHARE_OF_BOUND * bound * scale[c] / BOUNDS.standard_errors).powi(2));
            if allowed > 0.0 { own[c] / allowed } else { 0.0 }
        };
        (0..3).map(ratio).fold(0.0, f64::max)
    };
    median(shown.all().filter(|(_, decides)| *decides).map(|(tile, _)| of_tile(tile)).collect())
}

#[cfg(test)]
mod tests {
    use mateval_image::{LinearRgb, Mask, Picture};

    use super::*;
    use crate::compare::file::MaterialKind;

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
        // Without noise of theirs: three standard errors of 16 * 16 pixels, each off by 0.1 / 2, against 0.5 * 0.01 *
        // 0.5.
        let errors: f64 = 3.0 * (0.1 / 2.0) / 16.0;
        let expected = (errors / 0.0025).powi(2);
        assert!((ratio(0.1, 0.0) / expected - 1.0).abs() < 1e-3);
        assert_eq!(ratio(0.0, 0.0), 0.0);
    }
}
