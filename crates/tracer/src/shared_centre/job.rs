//! A render of several views: checks of its arguments, then one exposure per plane and seed.

use std::sync::atomic::{AtomicUsize, Ordering};

use mateval_scene::Camera;

use super::plane::Plane;
use super::splat::{self, Subject, TileCounts};
use super::view_light::{ViewLight, ViewsRender};
use crate::error::{RequestFault, TracerError};
use crate::material_source::MaterialSource;
use crate::path::PathCounts;
use crate::render::{self, RenderStats};
use crate::settings::RenderSettings;

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
    pub(crate) fn planes(&self, variants: usize) -> Result<Vec<Plane>, TracerError> {
        self.settings.check()?;
        self.subject.lighting.check(self.subject.world.emitters().groups(), variants)?;
        check_seeds(self.seeds)?;
        Ok(planes(self.cameras, self.settings.samples))
    }

    /// The number of tiles that [`Self::render`] exposes.
    pub(crate) fn tiles(&self, planes: &[Plane]) -> usize {
        self.seeds.len() * planes.iter().map(|plane| plane.tiles().len()).sum::<usize>()
    }

    /// Renders the views for the subject's material variants, which share their paths and are at most `K`.
    pub(crate) fn render<const K: usize>(&self, planes: &[Plane], progress: &Progress<'_>) -> Vec<ViewsRender>
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
            let halves = planes
                .iter()
                .flat_map(|plane| splat::expose::<_, K>(self.subject, plane, &settings, &mut counts, &done));
            for (view, halves) in halves.enumerate() {
                for (views, half) in views.iter_mut().zip(halves) {
                    views[view].halves.push(half);
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

/// One plane for all cameras if they share a centre, otherwise one per camera.
fn planes(cameras: &[Camera], samples: u32) -> Vec<Plane> {
    match Plane::new(cameras, samples) {
        Some(plane) => vec![plane],
        None => cameras.iter().map(|camera| Plane::alone(camera, samples)).collect(),
    }
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
