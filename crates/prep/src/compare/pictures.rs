//! The two renderers' pictures: reads Blender's, and renders ours in passes, so that samples can be added until the checks
//! are decided.

use std::path::{Path, PathBuf};

use mateval_dataset::dataset::View;
use mateval_dataset::render_file::{RENDER_FILE, RenderFile};
use mateval_dataset::{Camera, Progress, Report, SceneId, json, splitmix64};
use mateval_image::{ImageError, LinearRgb, Picture, exr_io};
use mateval_tracer::{RenderSettings, ViewLight, World, render_views};

use super::file::{Check, State, file_check};
use super::tiles::Halves;
use crate::error::PrepError;
use crate::render::MAX_BOUNCES;

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

    /// Samples per pixel of each half.
    pub(super) fn samples(&self) -> Result<u32, PrepError> {
        let render: RenderFile = json::read(&self.folder.join(RENDER_FILE))?;
        Ok(render.samples_each_half)
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

/// The seeds of the two halves of a scene's pass. No other render of the scene uses them, so that the errors are
/// independent.
pub(super) fn seeds(scene: &SceneId, pass: usize) -> [u64; 2] {
    ["a", "b"].map(|half| {
        let number = if pass == 0 { String::new() } else { format!("/{pass}") };
        splitmix64::seed_of(&format!("compare/{scene}/{half}{number}"))
    })
}

/// The most memory that the pictures of all lights may take at once: 138 lights in two halves of five views of 480 x 270
/// pixels.
const MOST_BYTES: u64 = 2 << 30;

/// The built-in tracer's pictures of a scene's views, to which passes are added.
pub(super) struct OurRender {
    /// The samples per pixel of each half, by pass.
    passes: Vec<u32>,
    /// In the order of the views; empty before the first pass.
    pub(super) lights: Vec<OurLight>,
}

impl OurRender {
    pub(super) fn new() -> Self {
        Self { passes: Vec::new(), lights: Vec::new() }
    }

    pub(super) fn passes(&self) -> &[u32] {
        &self.passes
    }

    /// Samples per pixel of each half, of all passes.
    pub(super) fn samples(&self) -> u32 {
        self.passes.iter().sum()
    }

    /// Renders another pass.
    pub(super) fn add(
        &mut self,
        world: &World,
        id: &SceneId,
        views: &[&View],
        samples: u32,
        progress: Progress<'_>,
    ) -> Result<(), PrepError> {
        let added = render_pass(world, id, views, samples, seeds(id, self.passes.len()), progress)?;
        let share = f64::from(samples) / f64::from(self.samples() + samples);
        match self.lights.is_empty() {
            true => self.lights = added,
            false => self.lights.iter_mut().zip(&added).for_each(|(all, added)| all.blend(added, share)),
        }
        self.passes.push(samples);
        Ok(())
    }
}

impl OurLight {
    /// Moves every picture towards `other` by this share of the way.
    fn blend(&mut self, other: &Self, share: f64) {
        let own = std::iter::once(&mut self.rgb).chain(&mut self.groups);
        for (own, other) in own.zip(std::iter::once(&other.rgb).chain(&other.groups)) {
            for (own, other) in [(&mut own.a, &other.a), (&mut own.b, &other.b)] {
                for (own, other) in own.pixels_mut().iter_mut().zip(other.pixels()) {
                    for c in 0..3 {
                        let [from, to] = [own.0[c], other.0[c]].map(f64::from);
                        own.0[c] = (from + share * (to - from)) as f32;
                    }
                }
            }
        }
    }
}

/// Renders `views` of the scene: all from one set of paths where they share a centre and their pictures fit in memory,
/// otherwise one after the other.
fn render_pass(
    world: &World,
    id: &SceneId,
    views: &[&View],
    samples: u32,
    seeds: [u64; 2],
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
        let rendered = render_views(world, cameras, &settings, &seeds, &shown)?;
        found.extend(rendered.views.iter().map(light_of));
    }
    Ok(found)
}

fn light_of(view: &ViewLight) -> OurLight {
    let [a, b] = [0, 1].map(|half| &view.by_seed[half]);
    let groups = a.pictures().iter().zip(b.pictures());
    let groups = groups.map(|(a, b)| Halves { a: a.clone(), b: b.clone() }).collect();
    OurLight { rgb: Halves { a: a.sum(), b: b.sum() }, groups }
}

#[cfg(test)]
mod tests {
    use mateval_image::{LinearRgb, Picture};

    use super::*;

    /// Passes of 16, 16 and 32 samples count in proportion to their samples.
    #[test]
    fn passes_count_by_their_samples() {
        let light = |value: f32| {
            let halves = || Halves {
                a: Picture::filled(2, 2, LinearRgb([value; 3])),
                b: Picture::filled(2, 2, LinearRgb([value + 1.0; 3])),
            };
            OurLight { rgb: halves(), groups: vec![halves()] }
        };
        let mut all = light(0.0);
        all.blend(&light(4.0), 0.5);
        all.blend(&light(8.0), 0.5);
        for halves in [&all.rgb, &all.groups[0]] {
            assert_eq!((halves.a.pixels()[3], halves.b.pixels()[3]), (LinearRgb([5.0; 3]), LinearRgb([6.0; 3])));
        }
    }

    #[test]
    fn no_two_passes_share_a_seed() {
        let id = SceneId::new("room").unwrap();
        let all: std::collections::BTreeSet<u64> = (0..4).flat_map(|pass| seeds(&id, pass)).collect();
        assert_eq!(all.len(), 8);
    }
}
