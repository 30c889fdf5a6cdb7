//! A render of several views: checks of its arguments, then one exposure per plane and seed.

use std::sync::atomic::{AtomicUsize, Ordering};

use mateval_scene::Camera;

use super::plane::Plane;
use super::splat::{self, Subject, TileCounts};
use super::view_light::{ViewLight, ViewsRender};
use crate::error::{RequestFault, TracerError};
use crate::path::MaterialSource;
use crate::path::PathCounts;
use crate::path::RenderSettings;
use crate::render::{self, RenderStats};

/// Views to be rendered.
pub(crate) struct ViewsJob<'a, M> {
    pub(crate) subject: Subject<'a, M>,
    pub(crate) cameras: &'a [Camera],
    pub(crate) settings: &'a RenderSettings,
    pub(crate) seeds: &'a [u64],
}

/// Counts finished tiles and reports them.
pub(crate) struct Progress<'a> {
    finished: AtomicUsize,
    total: usize,
    report: &'a (dyn Fn(usize, usize) + Sync),
}

impl<'a> Progress<'a> {
    /// `report` is called with the number of finished tiles and `total`.
    pub(crate) fn new(total: usize, report: &'a (dyn Fn(usize, usize) + Sync)) -> Self {
        Self { finished: AtomicUsize::new(0), total, report }
    }

    fn advance(&self) {
        (self.report)(self.finished.fetch_add(1, Ordering::Relaxed) + 1, self.total);
    }
}

impl<'a, M: Copy> ViewsJob<'a, M> {
    /// Checks the arguments, for `variants` material variants, and returns the planes to expose.
    pub(crate) fn planes(&self, variants: usize) -> Result<Vec<SharedPlane>, TracerError> {
        self.settings.check()?;
        self.subject.lighting.check(self.subject.world.emitters().groups(), variants)?;
        check_seeds(self.seeds)?;
        Ok(planes(self.cameras, self.settings.samples))
    }

    /// The number of tiles that [`Self::render`] exposes.
    pub(crate) fn tiles(&self, planes: &[SharedPlane]) -> usize {
        self.seeds.len() * planes.iter().map(|shared| shared.plane.tiles().len()).sum::<usize>()
    }

    /// Renders the views for the subject's material variants, which share their paths and are at most `K`.
    pub(crate) fn render<const K: usize>(&self, planes: &[SharedPlane], progress: &Progress<'_>) -> Vec<ViewsRender>
    where
        M: MaterialSource<'a, K> + Sync,
    {
        let done = || progress.advance();
        let blank = ViewLight { halves: Vec::with_capacity(self.seeds.len()) };
        let mut views: Vec<Vec<ViewLight>> = vec![vec![blank; self.cameras.len()]; self.subject.variants];
        let mut counts = Vec::new();
        // Expose every plane once per seed.
        for &seed in self.seeds {
            let settings = RenderSettings { seed, ..*self.settings };
            for shared in planes {
                let of_views = splat::expose::<_, K>(self.subject, &shared.plane, &settings, &mut counts, &done);
                for (view, halves) in shared.views.iter().zip(of_views) {
                    for (views, half) in views.iter_mut().zip(halves) {
                        views[*view].halves.push(half);
                    }
                }
            }
        }
        // Attach the counts of each variant.
        let of_variant = |(variant, views): (usize, Vec<ViewLight>)| ViewsRender {
            views,
            passes: planes.len(),
            stats: stats(&counts, variant),
        };
        views.into_iter().enumerate().map(of_variant).collect()
    }
}

/// A plane, and which cameras see it.
#[derive(Clone, Debug)]
pub(crate) struct SharedPlane {
    pub(super) plane: Plane,
    /// Indices of the cameras, in the order of the plane's views.
    pub(super) views: Vec<usize>,
}

/// A plane for each group of cameras with one centre.
pub(super) fn planes(cameras: &[Camera], samples: u32) -> Vec<SharedPlane> {
    let mut groups: Vec<SharedPlane> = Vec::new();
    for (view, camera) in cameras.iter().enumerate() {
        let joined = groups.iter_mut().find_map(|group| Some((group.plane.with(camera)?, group)));
        match joined {
            Some((plane, group)) => {
                group.plane = plane;
                group.views.push(view);
            }
            None => groups.push(SharedPlane { plane: Plane::alone(camera, samples), views: vec![view] }),
        }
    }
    groups
}

fn check_seeds(seeds: &[u64]) -> Result<(), RequestFault> {
    let twice = seeds.iter().enumerate().find(|(place, seed)| seeds[..*place].contains(seed));
    match twice {
        Some((_, seed)) => Err(RequestFault::RepeatedSeed(*seed)),
        None => Ok(()),
    }
}

fn stats(tiles: &[TileCounts], variant: usize) -> RenderStats {
    let paths: Vec<PathCounts> = tiles.iter().map(|tile| tile.path).collect();
    render::stats(tiles.iter().map(|tile| tile.paths).sum(), &paths, variant)
}
