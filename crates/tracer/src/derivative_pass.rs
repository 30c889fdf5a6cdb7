//! A render that keeps the history of its paths: the derivatives of each pixel by the base colours along them.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{Vec2, Vec3};
use mateval_image::{LinearRgb, Picture};
use mateval_scene::Camera;
use mateval_scene::reference::SurfaceIndex;
use rayon::prelude::*;

use crate::error::RequestFault;
use crate::film::{self, Tile};
use crate::material_source::AboveBlack;
use crate::path::PathTracer;
use crate::path_history::PathHistory;
use crate::render::camera_start;
use crate::settings::RenderSettings;
use crate::world::World;

/// The derivative of one sample of a pixel by the base colour at one place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelDerivative {
    /// The pixel's place in the picture, row by row.
    pub(crate) pixel: usize,
    pub(crate) surface: SurfaceIndex,
    /// The uv of the surface.
    pub(crate) uv: Vec2,
    /// Per channel, of one sample.
    pub(crate) value: Vec3,
}

/// The most memory that derivatives may take.
pub(crate) const MOST_BYTES: u64 = 1 << 30;
/// The memory of one derivative by a colour: a sum in `f64` and a result in `f32`.
pub(crate) const ENTRY_BYTES: u64 = 3 * (size_of::<f64>() + size_of::<f32>()) as u64;

/// Tiles traced in parallel before their derivatives are summed in order, and samples of each. Together they need a
/// few tens of megabytes at most.
const TILES_AT_ONCE: usize = 64;
const SAMPLES_AT_ONCE: u32 = 4;

/// A tile's derivatives, and the sums of its pixels' samples.
type TracedTile = (Vec<PixelDerivative>, Vec<Vec3>);

/// Checks what every derivative needs: settings in range, and a world without stage lights, which see only a part of
/// each material.
pub(crate) fn check(world: &World, settings: &RenderSettings) -> Result<(), RequestFault> {
    settings.check()?;
    if world.emitters().are_on_stage() { Err(RequestFault::StageDerivatives) } else { Ok(()) }
}

/// Traces the paths of [`crate::render()`] and calls `add` for all derivatives, in an order that does not depend on the
/// number of threads. Returns the picture. `progress` is called with finished batches of tiles and their total.
pub(crate) fn trace(
    world: &World,
    camera: &Camera,
    settings: &RenderSettings,
    mut add: impl FnMut(&PixelDerivative),
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Picture<LinearRgb> {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let tiles = film::tiles(width, height);
    let total = tiles.len() * settings.samples.div_ceil(SAMPLES_AT_ONCE) as usize;
    let finished = AtomicUsize::new(0);
    let mut sums = vec![[0.0_f64; 3]; width * height];
    for tiles in tiles.chunks(TILES_AT_ONCE) {
        for first in (0..settings.samples).step_by(SAMPLES_AT_ONCE as usize) {
            // Trace the tiles in parallel.
            let traced: Vec<TracedTile> = tiles
                .par_iter()
                .map(|tile| {
                    let traced = trace_tile(world, camera, settings, tile, first);
                    progress(finished.fetch_add(1, Ordering::Relaxed) + 1, total);
                    traced
                })
                .collect();
            // Add them up in order.
            for (tile, (derivatives, radiances)) in tiles.iter().zip(traced) {
                derivatives.iter().for_each(&mut add);
                for ([x, y], radiance) in tile.pixels().zip(radiances) {
                    let sum = &mut sums[y * width + x];
                    sum.iter_mut().zip(radiance.to_array()).for_each(|(sum, value)| *sum += f64::from(value));
                }
            }
        }
    }
    let mean = |sum: [f64; 3]| LinearRgb(sum.map(|value| (value / f64::from(settings.samples)) as f32));
    Picture::from_fn(width, height, |x, y| mean(sums[y * width + x]))
}

/// Traces the samples of a tile from `first` on that are traced at once.
fn trace_tile(world: &World, camera: &Camera, settings: &RenderSettings, tile: &Tile, first: u32) -> TracedTile {
    let width = camera.intrinsics.width as usize;
    let pixels: Vec<[usize; 2]> = tile.pixels().collect();
    let mut tracer = PathTracer::<_, 1>::new(world, AboveBlack(world), *settings);
    let mut history = PathHistory::default();
    let (mut derivatives, mut radiances) = (Vec::new(), vec![Vec3::ZERO; pixels.len()]);
    for index in first..settings.samples.min(first.saturating_add(SAMPLES_AT_ONCE)) {
        let starts = pixels.iter().map(|&pixel| camera_start(camera, settings.seed, pixel, index));
        tracer.trace_recorded(starts, &mut history, |_, _, _| ());
        let light = history.walk_back(|vertex| {
            if vertex.value != Vec3::ZERO && vertex.value.is_finite() {
                let [x, y] = pixels[vertex.path];
                let (surface, uv, value) = (vertex.surface, vertex.uv, vertex.value);
                derivatives.push(PixelDerivative { pixel: y * width + x, surface, uv, value });
            }
        });
        radiances.iter_mut().zip(light).for_each(|(sum, light)| *sum += light);
    }
    (derivatives, radiances)
}
