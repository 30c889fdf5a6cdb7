//! Several views of one centre from one set of paths.
//!
//! Radiance along a direction is the same in every view from one place. So paths are drawn once over the union of the
//! views' pictures, on the image plane of the first camera (`plane`), spread evenly (`cell_points`) and put into every
//! view that holds their direction (`splat`). A path counts there by how much of that view's picture the path stands
//! for: the Jacobian between the two planes over the known number of samples. Nothing is divided by sums of weights, so
//! every pixel's expectation is its radiance under a box filter of one pixel.

mod cell_points;
mod plane;
mod splat;

use std::sync::atomic::{AtomicUsize, Ordering};

use mateval_image::Picture;
use mateval_scene::Camera;

use crate::error::TracerError;
use crate::light_basis::{LightBasis, LightGroups};
use crate::path::PathCounts;
use crate::render::{self, RenderSettings, RenderStats};
use crate::world::World;
use plane::Plane;

/// Views of one world.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewsRender {
    /// In the order of the cameras.
    pub views: Vec<ViewLight>,
    /// How many sets of paths were drawn a seed: 1 if the views share a centre, else one a view.
    pub passes: usize,
    /// What happened, over all passes and seeds.
    pub stats: RenderStats,
}

/// What one camera sees, in independent halves (or as many parts as there were seeds).
#[derive(Clone, Debug, PartialEq)]
pub struct ViewLight {
    /// In the order of the seeds.
    pub halves: Vec<HalfLight>,
}

/// One of several independent estimates of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfLight {
    /// Linear radiance, one picture a group of lights.
    pub basis: LightBasis,
    /// How many paths each pixel received.
    pub counts: Picture<u32>,
}

/// Renders what all `cameras` see, once a seed, one picture a group of lights.
///
/// Where the cameras share a centre ([`share_centre`]) all views come from one set of paths a seed, else each view from
/// its own. A pixel gets about `settings.samples` paths a seed; `settings.seed` itself is not used. `progress` is told,
/// from any thread, how many tiles of how many are done. The same bytes for any number of threads of the current rayon
/// pool. Fails for settings that make no sense, for seeds that occur twice (halves would be one) and for groups made for
/// another number of lights.
pub fn render_views(
    world: &World,
    cameras: &[Camera],
    groups: &LightGroups,
    settings: &RenderSettings,
    seeds: &[u64],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<ViewsRender, TracerError> {
    render::check(settings)?;
    check(world, groups, seeds)?;
    let planes = planes(cameras, settings.samples);
    let total = seeds.len() * planes.iter().map(|plane| plane.tiles().len()).sum::<usize>();
    let finished = AtomicUsize::new(0);
    let done = || progress(finished.fetch_add(1, Ordering::Relaxed) + 1, total);
    let mut views = vec![ViewLight { halves: Vec::with_capacity(seeds.len()) }; cameras.len()];
    let mut counts = Vec::new();
    for &seed in seeds {
        let settings = RenderSettings { seed, ..*settings };
        let halves = planes.iter().flat_map(|plane| splat::expose(world, plane, groups, &settings, &mut counts, &done));
        for (view, half) in views.iter_mut().zip(halves) {
            view.halves.push(half);
        }
    }
    Ok(ViewsRender { views, passes: planes.len(), stats: stats(&counts) })
}

/// Whether views from these cameras can come from one set of paths: all stand in one place, to the rounding of rays'
/// origins, and no picture reaches further than 75 degrees from where the first one looks.
pub fn share_centre(cameras: &[Camera]) -> bool {
    Plane::new(cameras, 1).is_some()
}

/// One plane for all cameras, or one for each.
fn planes(cameras: &[Camera], samples: u32) -> Vec<Plane> {
    match Plane::new(cameras, samples) {
        Some(plane) => vec![plane],
        None => cameras.iter().map(|camera| Plane::alone(camera, samples)).collect(),
    }
}

fn check(world: &World, groups: &LightGroups, seeds: &[u64]) -> Result<(), TracerError> {
    let lights = world.scene().lights.len();
    if groups.lights() != lights {
        let found = groups.lights();
        return Err(TracerError::Invalid(format!("groups of {found} lights for a scene of {lights}")));
    }
    let twice = seeds.iter().enumerate().find(|(place, seed)| seeds[..*place].contains(seed));
    match twice {
        Some((_, seed)) => Err(TracerError::Invalid(format!("seed {seed} occurs twice, expected one a half"))),
        None => Ok(()),
    }
}

fn stats(tiles: &[splat::TileCounts]) -> RenderStats {
    let paths: Vec<PathCounts> = tiles.iter().map(|tile| tile.path).collect();
    render::stats(tiles.iter().map(|tile| tile.paths).sum(), &paths)
}
