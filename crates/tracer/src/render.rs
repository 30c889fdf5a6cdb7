//! Renders one view as a single picture: traces its tiles and averages their samples with a box filter of one pixel.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec2;
use mateval_dataset::Camera;
use mateval_image::{LinearRgb, Picture};
use rayon::prelude::*;

use crate::error::TracerError;
use crate::path::{OwnMaterials, PathCounts, PathTracer, RenderSettings};
use crate::ray::Ray;
use crate::sampling::Sampler;
use crate::world::World;

/// Counts of what happened along the paths of a render.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderStats {
    /// Paths started.
    pub paths: u64,
    /// Rays that searched for the nearest surface.
    pub rays: u64,
    /// Shadow rays: those that tested whether an emitter is visible.
    pub shadow_rays: u64,
    /// Share of paths that `max_bounces` ended.
    pub capped_share: f64,
    /// Throughput of the paths that `max_bounces` ended, averaged over all paths. Times the radiance around them, it
    /// bounds the light that is missing.
    pub capped_throughput: f64,
    /// Contributions left out because they were not finite. Each is a bug.
    pub not_finite: u64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Render {
    /// Linear radiance.
    pub picture: Picture<LinearRgb>,
    pub stats: RenderStats,
}

/// Renders what `camera` sees. `progress` is called from any thread with the number of finished tiles and their total.
///
/// The bytes of the picture are the same for any number of threads in the current rayon pool. Fails if a setting is out
/// of range.
pub fn render(
    world: &World,
    camera: &Camera,
    settings: &RenderSettings,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Render, TracerError> {
    settings.check()?;
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let tiles = tiles(width, height);
    let progress = Progress::new(tiles.len(), progress);
    // Each pixel is rendered by one thread, so that the result does not depend on their number.
    let developed: Vec<(Vec<[f64; 3]>, PathCounts)> = tiles
        .par_iter()
        .map(|tile| {
            let developed = develop_tile(world, camera, settings, tile);
            progress.advance();
            developed
        })
        .collect();
    let mut picture = Picture::filled(width, height, LinearRgb::default());
    let mut counts = Vec::with_capacity(tiles.len());
    for (tile, (pixels, of_tile)) in tiles.iter().zip(developed) {
        for ([x, y], pixel) in tile.pixels().zip(pixels) {
            picture.set(x, y, LinearRgb(pixel.map(|v| v as f32)));
        }
        counts.push(of_tile);
    }
    Ok(Render { picture, stats: stats(&counts, 0) })
}

/// The mean of each pixel's samples. A batch of paths holds one path per pixel.
fn develop_tile(world: &World, camera: &Camera, settings: &RenderSettings, tile: &Tile) -> (Vec<[f64; 3]>, PathCounts) {
    let mut tracer = PathTracer::<_, 1>::new(world, OwnMaterials(world), *settings);
    let mut sums = vec![[0.0_f64; 3]; tile.pixels().count()];
    for index in 0..settings.samples {
        let starts = tile.pixels().map(|pixel| camera_start(camera, settings.seed, pixel, index));
        tracer.trace(starts, |pixel, _, [value]| {
            for (channel, value) in sums[pixel].iter_mut().zip(value.to_array()) {
                *channel += f64::from(value);
            }
        });
    }
    for sum in &mut sums {
        *sum = sum.map(|channel| channel / f64::from(settings.samples));
    }
    (sums, tracer.counts)
}

/// The start of path `index` of a pixel: its random numbers and its ray.
pub(crate) fn camera_start(camera: &Camera, seed: u64, [x, y]: [usize; 2], index: u32) -> (Sampler, Ray) {
    let sampler = Sampler::new(seed, [x as u32, y as u32], index);
    let [dx, dy, ..] = sampler.set(0);
    let place = DVec2::new(x as f64 + f64::from(dx), y as f64 + f64::from(dy));
    (sampler, Ray::endless(camera.position().as_vec3(), camera.direction(place).as_vec3()))
}

/// Sums the counts of all tiles, for one of the variants that share the paths.
pub(crate) fn stats(tiles: &[PathCounts], variant: usize) -> RenderStats {
    let sum = |count: fn(&PathCounts) -> u64| tiles.iter().map(count).sum::<u64>();
    let capped_throughput: f64 = tiles.iter().map(|tile| tile.capped_throughput[variant]).sum();
    let paths = sum(|tile| tile.paths);
    let all = paths.max(1) as f64;
    RenderStats {
        paths,
        rays: sum(|tile| tile.rays),
        shadow_rays: sum(|tile| tile.shadow_rays),
        capped_share: sum(|tile| tile.capped) as f64 / all,
        capped_throughput: capped_throughput / all,
        not_finite: tiles.iter().map(|tile| tile.not_finite[variant]).sum(),
    }
}

/// Pixels along each side of a tile.
const TILE: usize = 16;

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tile {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

/// All tiles of a picture, row by row.
pub(crate) fn tiles(width: usize, height: usize) -> Vec<Tile> {
    let starts = |size: usize| (0..size).step_by(TILE);
    starts(height)
        .flat_map(|y| starts(width).map(move |x| (x, y)))
        .map(|(x, y)| Tile { x, y, width: TILE.min(width - x), height: TILE.min(height - y) })
        .collect()
}

impl Tile {
    /// The tile's pixels (x, y), row by row.
    pub(crate) fn pixels(&self) -> impl Iterator<Item = [usize; 2]> + Clone + use<> {
        let Self { x, y, width, height } = *self;
        (y..y + height).flat_map(move |row| (x..x + width).map(move |column| [column, row]))
    }
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

    pub(crate) fn advance(&self) {
        (self.report)(self.finished.fetch_add(1, Ordering::Relaxed) + 1, self.total);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_hold_every_pixel_once() {
        let mut pixels: Vec<[usize; 2]> = tiles(37, 18).iter().flat_map(Tile::pixels).collect();
        pixels.sort_unstable();
        assert!(pixels.into_iter().eq((0..37).flat_map(|x| (0..18).map(move |y| [x, y]))));
    }
}
