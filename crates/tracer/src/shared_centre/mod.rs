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

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use mateval_image::Picture;
use mateval_scene::Camera;

use crate::error::TracerError;
use crate::light_basis::{LightBasis, LightGroups};
use crate::path::{Painted, PathCounts, TOGETHER};
use crate::render::{self, RenderSettings, RenderStats};
use crate::repaint::Repaint;
use crate::world::World;
use plane::Plane;
use splat::Subject;

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
    let lighting = Lighting::Apart(groups);
    let order = Order { subject: Subject { world, painted: None, lighting }, cameras, settings, seeds };
    let planes = order.planes()?;
    let bar = Bar { finished: AtomicUsize::new(0), total: order.tiles(&planes), progress };
    let [render] = order.render(&planes, &bar);
    Ok(render)
}

/// Which pictures are made of a view's light.
#[derive(Clone, Copy, Debug)]
pub enum Lighting<'a> {
    /// One a group of lights, of the scene's own radiances.
    Apart(&'a LightGroups),
    /// For each prediction the same number of mixes, a picture each.
    Mixed(&'a [Vec<LightMix>]),
}

/// For each light what its radiance is multiplied by, a channel, not negative.
pub type LightMix = Vec<[f64; 3]>;

impl Lighting<'_> {
    /// How many pictures there are of a view.
    fn pictures(&self) -> usize {
        match self {
            Self::Apart(groups) => groups.groups().len(),
            Self::Mixed(mixes) => mixes.first().map_or(0, Vec::len),
        }
    }

    /// Fails where the lights are not `lights`, predictions not `predictions`, or weights make no sense.
    fn check(&self, lights: usize, predictions: usize) -> Result<(), TracerError> {
        let mixes = match self {
            Self::Apart(groups) if groups.lights() == lights => return Ok(()),
            Self::Apart(groups) => {
                let found = groups.lights();
                return Err(TracerError::Invalid(format!("groups of {found} lights for a scene of {lights}")));
            }
            Self::Mixed(mixes) => *mixes,
        };
        let fit = mixes.len() == predictions
            && mixes.iter().all(|of| of.len() == self.pictures() && of.iter().all(|mix| mix.len() == lights));
        let weights = mixes.iter().flatten().flatten().flatten();
        if fit && { weights }.all(|weight| weight.is_finite() && *weight >= 0.0) {
            return Ok(());
        }
        let what = format!("mixes that do not fit {predictions} predictions and {lights} lights, or are negative");
        Err(TracerError::Invalid(what))
    }
}

/// [`render_views`] with predictions in place of the world's own materials; one a prediction of the range `which`.
///
/// Up to eight predictions are followed by the same paths. Each gets the same bytes as it gets alone. Fails also where
/// `which` names predictions that `repaint` does not hold, or mixes do not fit predictions and lights.
#[allow(clippy::too_many_arguments)] // what, from where, by what light, how: none belongs to another
pub fn render_repainted(
    world: &World,
    repaint: &Repaint,
    which: Range<usize>,
    cameras: &[Camera],
    lighting: Lighting<'_>,
    settings: &RenderSettings,
    seeds: &[u64],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<ViewsRender>, TracerError> {
    check_predictions(world, repaint, &which)?;
    let subject = |first| Subject { world, painted: Some(Painted { repaint, first }), lighting };
    let order = |first| Order { subject: subject(first), cameras, settings, seeds };
    let planes = order(0).planes()?;
    let rounds = rounds(which);
    let total = order(0).tiles(&planes) * rounds.len();
    let bar = Bar { finished: AtomicUsize::new(0), total, progress };
    let mut renders = Vec::new();
    for round in rounds {
        let order = order(round.start);
        match round.len() {
            1 => renders.extend(order.render::<1>(&planes, &bar)),
            2 => renders.extend(order.render::<2>(&planes, &bar)),
            3 | 4 => renders.extend(order.render::<4>(&planes, &bar).into_iter().take(round.len())),
            _ => renders.extend(order.render::<8>(&planes, &bar).into_iter().take(round.len())),
        }
    }
    Ok(renders)
}

fn rounds(which: Range<usize>) -> Vec<Range<usize>> {
    let end = which.end;
    which.step_by(TOGETHER).map(|start| start..end.min(start + TOGETHER)).collect()
}

fn check_predictions(world: &World, repaint: &Repaint, which: &Range<usize>) -> Result<(), TracerError> {
    let predictions = repaint.predictions();
    if repaint.surfaces() != world.scene().surfaces.len() {
        return Err(TracerError::Invalid("the predictions were made for another world".into()));
    }
    if which.end > predictions {
        return Err(TracerError::Invalid(format!("predictions {which:?} of {predictions}")));
    }
    Ok(())
}

/// Pictures to be made.
struct Order<'a> {
    subject: Subject<'a>,
    cameras: &'a [Camera],
    settings: &'a RenderSettings,
    seeds: &'a [u64],
}

/// How far all tiles are.
struct Bar<'a> {
    finished: AtomicUsize,
    total: usize,
    progress: &'a (dyn Fn(usize, usize) + Sync),
}

impl Order<'_> {
    fn planes(&self) -> Result<Vec<Plane>, TracerError> {
        render::check(self.settings)?;
        let Subject { world, painted, lighting } = &self.subject;
        let predictions = painted.map_or(1, |painted| painted.repaint.predictions());
        lighting.check(world.emitters().groups(), predictions)?;
        check(self.seeds)?;
        Ok(planes(self.cameras, self.settings.samples))
    }

    fn tiles(&self, planes: &[Plane]) -> usize {
        self.seeds.len() * planes.iter().map(|plane| plane.tiles().len()).sum::<usize>()
    }

    fn render<const K: usize>(&self, planes: &[Plane], bar: &Bar<'_>) -> [ViewsRender; K] {
        let done = || (bar.progress)(bar.finished.fetch_add(1, Ordering::Relaxed) + 1, bar.total);
        let blank = ViewLight { halves: Vec::with_capacity(self.seeds.len()) };
        let mut views: [Vec<ViewLight>; K] = std::array::from_fn(|_| vec![blank.clone(); self.cameras.len()]);
        let mut counts = Vec::new();
        for &seed in self.seeds {
            let settings = RenderSettings { seed, ..*self.settings };
            let halves =
                planes.iter().flat_map(|plane| splat::expose::<K>(self.subject, plane, &settings, &mut counts, &done));
            for (view, halves) in halves.enumerate() {
                for (views, half) in views.iter_mut().zip(halves) {
                    views[view].halves.push(half);
                }
            }
        }
        let mut views = views.into_iter().enumerate();
        std::array::from_fn(|_| {
            let (prediction, views) = views.next().expect("there are as many as predictions");
            ViewsRender { views, passes: planes.len(), stats: stats(&counts, prediction) }
        })
    }
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

fn check(seeds: &[u64]) -> Result<(), TracerError> {
    let twice = seeds.iter().enumerate().find(|(place, seed)| seeds[..*place].contains(seed));
    match twice {
        Some((_, seed)) => Err(TracerError::Invalid(format!("seed {seed} occurs twice, expected one a half"))),
        None => Ok(()),
    }
}

fn stats(tiles: &[splat::TileCounts], prediction: usize) -> RenderStats {
    let paths: Vec<PathCounts> = tiles.iter().map(|tile| tile.path).collect();
    render::stats(tiles.iter().map(|tile| tile.paths).sum(), &paths, prediction)
}
