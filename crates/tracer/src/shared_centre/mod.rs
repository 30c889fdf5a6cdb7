//! Several views with a common centre, rendered from one set of paths.
//!
//! Radiance along a direction is the same in every view from one centre. So paths are distributed once over the union
//! of the views' pictures, on the image plane of the first camera, evenly (`plane`), and added to every view that
//! contains their direction. In each view a path has the weight of the picture area it represents: the Jacobian between
//! the two planes over the known number of samples. Nothing is divided by sums of weights, so the expectation of every
//! pixel is its radiance under a box filter of one pixel.

mod plane;

use std::array::from_fn;

use glam::{DVec2, DVec3, Vec3};
use mateval_dataset::Camera;
use mateval_dataset::reference::LightIndex;
use mateval_image::{LinearRgb, Picture};
use rayon::prelude::*;

use crate::error::{RequestFault, TracerError};
use crate::path::{MaterialSource, OwnMaterials, PathCounts, PathTracer, RenderSettings};
use crate::ray::Ray;
use crate::render::{self, Progress, RenderStats};
use crate::sampling::Sampler;
use crate::world::World;
use plane::{Numbering, Plane, PlaneView, Window, cell_points};

/// The pictures made from a view's light.
#[derive(Clone, Copy, Debug)]
pub enum Lighting<'a> {
    /// One per group of lights, under the scene's own radiances.
    Apart,
    /// For each prediction (or material variant) the same number of mixes, one picture each.
    Mixed(&'a [Vec<LightMix>]),
}

/// For each light a factor on its radiance, per channel, at least 0.
pub type LightMix = Vec<[f64; 3]>;

/// The views of one world.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewsRender {
    /// In the order of the cameras.
    pub views: Vec<ViewLight>,
    /// Counts over all views and seeds.
    pub stats: RenderStats,
}

/// The light that one camera sees, once for each seed: independent pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewLight {
    /// In the order of the seeds.
    pub by_seed: Vec<LightBasis>,
}

/// The light of a view, split by its source: pictures of one size, one per group of lights, or per mix of lights.
///
/// Light is linear in emission, so any other lighting by the same emitters is a weighted sum of the groups. All
/// pictures come from the same paths, since no decision along a path depends on radiance ([`crate::emitter`]).
#[derive(Clone, Debug, PartialEq)]
pub struct LightBasis {
    width: usize,
    height: usize,
    pictures: Vec<Picture<LinearRgb>>,
}

impl LightBasis {
    /// `count` black pictures.
    pub(crate) fn black(width: usize, height: usize, count: usize) -> Self {
        Self { width, height, pictures: vec![Picture::filled(width, height, LinearRgb::default()); count] }
    }

    /// Takes pictures of one size. Fails if the size of one differs.
    pub fn new(width: usize, height: usize, pictures: Vec<Picture<LinearRgb>>) -> Result<Self, TracerError> {
        if let Some(other) = pictures.iter().find(|picture| (picture.width(), picture.height()) != (width, height)) {
            let found = [other.width(), other.height()];
            return Err(RequestFault::PictureSize { found, expected: [width, height] }.into());
        }
        Ok(Self { width, height, pictures })
    }

    /// Linear radiance, one picture per group.
    pub fn pictures(&self) -> &[Picture<LinearRgb>] {
        &self.pictures
    }

    pub(crate) fn pictures_mut(&mut self) -> &mut [Picture<LinearRgb>] {
        &mut self.pictures
    }

    /// The view under the scene's own radiances.
    pub fn sum(&self) -> Picture<LinearRgb> {
        self.mix(|_| [1.0; 3])
    }

    /// The view with each group's radiance scaled by its entry of `weights`, per channel. Fails unless `weights` holds
    /// one entry per group.
    pub fn weighted(&self, weights: &[[f64; 3]]) -> Result<Picture<LinearRgb>, TracerError> {
        if weights.len() != self.pictures.len() {
            let (found, expected) = (weights.len(), self.pictures.len());
            return Err(RequestFault::WeightCount { found, expected }.into());
        }
        Ok(self.mix(|group| weights[group]))
    }

    fn mix(&self, weight: impl Fn(usize) -> [f64; 3]) -> Picture<LinearRgb> {
        let mut sums = vec![[0.0_f64; 3]; self.width * self.height];
        for (group, picture) in self.pictures.iter().enumerate() {
            let weight = weight(group);
            for (sum, value) in sums.iter_mut().zip(picture.pixels()) {
                for channel in 0..3 {
                    sum[channel] += weight[channel] * f64::from(value.0[channel]);
                }
            }
        }
        Picture::from_fn(self.width, self.height, |x, y| LinearRgb(sums[y * self.width + x].map(|v| v as f32)))
    }
}

/// Renders what all `cameras` see, once per seed, one picture per group of lights.
///
/// Views whose cameras share a centre ([`groups_with_one_centre`]) come from one set of paths per seed. A pixel gets
/// about `settings.samples` paths per seed; `settings.seed` is not used. `progress` is called from any thread with the
/// number of finished tiles and their total. The bytes of the pictures are the same for any number of threads in the
/// current rayon pool.
///
/// Fails if a setting is out of range, or if a seed occurs twice: two halves would be the same.
pub fn render_views(
    world: &World,
    cameras: &[Camera],
    settings: &RenderSettings,
    seeds: &[u64],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<ViewsRender, TracerError> {
    let (materials, lighting) = (OwnMaterials(world), Lighting::Apart);
    let job = ViewsJob { world, materials, first: 0, variants: 1, lighting, cameras, settings, seeds };
    let planes = job.planes(1)?;
    let mut renders = job.render::<1>(&planes, &Progress::new(job.tiles(&planes), progress));
    Ok(renders.pop().expect("there is one variant"))
}

/// The cameras in groups whose views can come from one set of paths, as indices: the cameras of a group stand at one
/// point, up to the rounding of ray origins, and no picture extends more than 75 degrees from where the group's first
/// camera looks. A camera belongs to the first group that will have it, so that cameras from elsewhere never change a
/// group.
pub fn groups_with_one_centre(cameras: &[Camera]) -> Vec<Vec<usize>> {
    planes(cameras, 1).into_iter().map(|group| group.views).collect()
}

/// Views to be rendered, of a world with some materials and lighting.
pub(crate) struct ViewsJob<'a, M> {
    pub(crate) world: &'a World,
    pub(crate) materials: M,
    /// The first of the material variants to trace.
    pub(crate) first: usize,
    /// The number of variants whose pictures are kept, at most `K`: the others only fill up the tracer's lanes.
    pub(crate) variants: usize,
    pub(crate) lighting: Lighting<'a>,
    pub(crate) cameras: &'a [Camera],
    pub(crate) settings: &'a RenderSettings,
    pub(crate) seeds: &'a [u64],
}

impl<'a, M: Copy> ViewsJob<'a, M> {
    /// Checks the arguments, for `variants` material variants, and returns the planes to expose.
    pub(crate) fn planes(&self, variants: usize) -> Result<Vec<SharedPlane>, TracerError> {
        self.settings.check()?;
        self.lighting.check(self.world.emitters().groups(), variants)?;
        check_seeds(self.seeds)?;
        Ok(planes(self.cameras, self.settings.samples))
    }

    /// The number of tiles that [`Self::render`] exposes.
    pub(crate) fn tiles(&self, planes: &[SharedPlane]) -> usize {
        self.seeds.len() * planes.iter().map(|shared| shared.plane.tiles().len()).sum::<usize>()
    }

    /// Renders the views for the job's material variants, at most `K`, which share their paths.
    pub(crate) fn render<const K: usize>(&self, planes: &[SharedPlane], progress: &Progress<'_>) -> Vec<ViewsRender>
    where
        M: MaterialSource<'a, K> + Sync,
    {
        let blank = ViewLight { by_seed: Vec::with_capacity(self.seeds.len()) };
        let mut views: Vec<Vec<ViewLight>> = vec![vec![blank; self.cameras.len()]; self.variants];
        let mut counts = Vec::new();
        // Expose every plane once per seed.
        for &seed in self.seeds {
            let settings = RenderSettings { seed, ..*self.settings };
            for shared in planes {
                let of_views = expose::<_, K>(self, &shared.plane, &settings, &mut counts, progress);
                for (view, halves) in shared.views.iter().zip(of_views) {
                    for (views, half) in views.iter_mut().zip(halves) {
                        views[*view].by_seed.push(half);
                    }
                }
            }
        }
        // Attach the counts of each variant.
        let of_variant =
            |(variant, views): (usize, Vec<ViewLight>)| ViewsRender { views, stats: render::stats(&counts, variant) };
        views.into_iter().enumerate().map(of_variant).collect()
    }
}

/// A plane, and which cameras see it.
#[derive(Clone, Debug)]
pub(crate) struct SharedPlane {
    plane: Plane,
    /// Indices of the cameras, in the order of the plane's views.
    views: Vec<usize>,
}

/// A plane for each group of cameras with one centre.
fn planes(cameras: &[Camera], samples: u32) -> Vec<SharedPlane> {
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

impl Lighting<'_> {
    /// The number of pictures per view of a scene with this many lights.
    fn pictures(&self, lights: usize) -> usize {
        match self {
            Self::Apart => lights,
            Self::Mixed(mixes) => mixes.first().map_or(0, Vec::len),
        }
    }

    /// Fails unless mixes are for `variants` variants and `lights` lights, with finite weights of at least 0.
    fn check(&self, lights: usize, variants: usize) -> Result<(), RequestFault> {
        let Self::Mixed(mixes) = self else { return Ok(()) };
        if mixes.len() != variants {
            return Err(RequestFault::MixedPredictions { found: mixes.len(), expected: variants });
        }
        let expected = self.pictures(lights);
        if let Some(prediction) = mixes.iter().position(|mixes| mixes.len() != expected) {
            return Err(RequestFault::MixCount { prediction, found: mixes[prediction].len(), expected });
        }
        mixes.iter().flatten().try_for_each(|mix| check_mix(mix, lights))
    }
}

fn check_mix(mix: &LightMix, lights: usize) -> Result<(), RequestFault> {
    if mix.len() != lights {
        return Err(RequestFault::WeightCount { found: mix.len(), expected: lights });
    }
    for (light, weights) in mix.iter().enumerate() {
        if let Some(&found) = weights.iter().find(|weight| !(weight.is_finite() && **weight >= 0.0)) {
            return Err(RequestFault::Weight { light: LightIndex(light), found });
        }
    }
    Ok(())
}

/// Tiles exposed per thread before they are merged. More tiles keep threads busier at the end of a batch and take more
/// memory.
const TILES_A_THREAD: usize = 4;

/// Exposes all views of `plane` with the seed of `settings`, per variant. Appends the counts of each tile to `counts`.
fn expose<'w, M: MaterialSource<'w, K> + Sync, const K: usize>(
    job: &ViewsJob<'w, M>,
    plane: &Plane,
    settings: &RenderSettings,
    counts: &mut Vec<PathCounts>,
    progress: &Progress<'_>,
) -> Vec<Vec<LightBasis>> {
    let exposure = Exposure { job, plane, settings, numbering: Numbering::new(plane.most_paths()) };
    let mut films = exposure.blank_films();
    // Tiles are merged in their own order, whichever finishes first; batches limit how many wait in memory.
    for batch in plane.tiles().chunks(TILES_A_THREAD * rayon::current_num_threads()) {
        let exposed: Vec<ExposedTile<K>> = batch
            .par_iter()
            .map(|tile| {
                let exposed = exposure.tile(tile);
                progress.advance();
                exposed
            })
            .collect();
        for tile in exposed {
            counts.push(tile.counts);
            for (film, part) in films.iter_mut().zip(tile.parts) {
                part.into_iter().for_each(|part| part.merge_into(film));
            }
        }
    }
    films
}

struct Exposure<'w, 'a, M> {
    job: &'a ViewsJob<'w, M>,
    plane: &'a Plane,
    settings: &'a RenderSettings,
    numbering: Numbering,
}

/// The contribution of a tile to every view that sees some of it.
struct ExposedTile<const K: usize> {
    parts: Vec<Option<Part<K>>>,
    counts: PathCounts,
}

/// A rectangle of one view: sums for all its pictures, pixel by pixel and variant by variant.
struct Part<const K: usize> {
    window: Window,
    sums: Vec<[[f64; 3]; K]>,
}

/// The number of paths traced together; slightly more if a cell has several.
const BATCH: usize = 256;

/// A path through one of the plane's cells.
struct PlanePath {
    cell: [i32; 2],
    /// Its index among the paths of the cell.
    rank: u32,
    point: [f32; 2],
    /// The number of paths in the cell.
    count: usize,
}

/// The light that a path has found from one light, per variant.
struct Contribution<const K: usize> {
    path: usize,
    light: LightIndex,
    values: [Vec3; K],
}

/// Buffers for exposing one tile.
struct TileTracer<'w, 'a, M, const K: usize> {
    exposure: &'a Exposure<'w, 'a, M>,
    tracer: PathTracer<'w, M, K>,
    paths: Vec<PlanePath>,
    contributions: Vec<Contribution<K>>,
    found: PathLight<K>,
}

/// The light found by one path, per variant.
struct PathLight<const K: usize> {
    /// By picture.
    sums: Vec<[[f64; 3]; K]>,
    /// The pictures that have received light, in order of their first contribution.
    touched: Vec<usize>,
    /// By light, of which there are few on one path: what is mixed to pictures when all of it is known.
    lights: Vec<(LightIndex, [[f64; 3]; K])>,
}

impl<'w, M: Copy> Exposure<'w, '_, M> {
    fn pictures(&self) -> usize {
        self.job.lighting.pictures(self.job.world.emitters().groups())
    }

    fn blank_films(&self) -> Vec<Vec<LightBasis>> {
        let blank = |PlaneView { intrinsics: k, .. }: &PlaneView| {
            LightBasis::black(k.width as usize, k.height as usize, self.pictures())
        };
        self.plane.views.iter().map(|view| vec![blank(view); self.job.variants]).collect()
    }

    fn tile<const K: usize>(&self, tile: &Window) -> ExposedTile<K>
    where
        M: MaterialSource<'w, K>,
    {
        let part = |view| self.plane.window(view, tile).map(|window| Part::new(window, self.pictures()));
        let parts = (0..self.plane.views.len()).map(part).collect();
        let mut exposed = ExposedTile { parts, counts: PathCounts::default() };
        let mut tile_tracer = TileTracer::new(self);
        let mut points = Vec::new();
        for cell in tile.cells() {
            cell_points(self.settings.seed, cell, self.plane.paths(cell), &mut points);
            for (rank, &point) in points.iter().enumerate() {
                tile_tracer.paths.push(PlanePath { cell, rank: rank as u32, point, count: points.len() });
            }
            if tile_tracer.paths.len() >= BATCH {
                tile_tracer.develop(&mut exposed);
            }
        }
        tile_tracer.develop(&mut exposed);
        exposed.counts = tile_tracer.tracer.counts;
        exposed
    }

    fn start(&self, path: &PlanePath) -> (Sampler, Ray) {
        let camera = &self.plane.camera;
        let direction = camera.direction(self.plane.ray_place(path.cell, path.point));
        let ray = Ray::endless(camera.position().as_vec3(), direction.as_vec3());
        (self.numbering.path_sampler(self.settings.seed, path.cell, path.rank), ray)
    }

    /// Adds the light of a path to the views that see it.
    fn splat<const K: usize>(&self, path: &PlanePath, found: &PathLight<K>, parts: &mut [Option<Part<K>>]) {
        let at = self.plane.ray_place(path.cell, path.point);
        for (view, part) in self.plane.views.iter().zip(parts) {
            let Some(part) = part else { continue };
            let Some(seen) = self.plane.seen(view, at) else { continue };
            if let Some(pixel) = part.pixel(seen.place.x, seen.place.y) {
                part.add(pixel, found, seen.pixels / path.count as f64);
            }
        }
    }
}

impl<'w, 'a, M: MaterialSource<'w, K>, const K: usize> TileTracer<'w, 'a, M, K> {
    fn new(exposure: &'a Exposure<'w, 'a, M>) -> Self {
        let ViewsJob { world, materials, .. } = *exposure.job;
        Self {
            exposure,
            tracer: PathTracer::new(world, materials, *exposure.settings),
            paths: Vec::new(),
            contributions: Vec::new(),
            found: PathLight {
                sums: vec![[[0.0; 3]; K]; exposure.pictures()],
                touched: Vec::new(),
                lights: Vec::new(),
            },
        }
    }

    /// Traces the waiting paths and adds their light to the tile's views, path by path.
    fn develop(&mut self, exposed: &mut ExposedTile<K>) {
        let Self { exposure, tracer, paths, contributions, found } = self;
        let starts = paths.iter().map(|path| exposure.start(path));
        tracer.trace(starts, |path, light, values| contributions.push(Contribution { path, light, values }));
        let ViewsJob { lighting, first, .. } = exposure.job;
        // Paths were traced together; the stable sort keeps the contributions of each path in their order.
        contributions.sort_by_key(|contribution| contribution.path);
        let mut rest = contributions.as_slice();
        for (which, path) in paths.iter().enumerate() {
            let (own, others) = rest.split_at(rest.partition_point(|contribution| contribution.path == which));
            rest = others;
            own.iter().for_each(|contribution| found.add(lighting, contribution));
            found.mix(lighting, *first);
            exposure.splat(path, found, &mut exposed.parts);
            found.clear();
        }
        paths.clear();
        contributions.clear();
    }
}

impl<const K: usize> PathLight<K> {
    fn add(&mut self, lighting: &Lighting<'_>, contribution: &Contribution<K>) {
        let values = contribution.values.map(|value| value.to_array().map(f64::from));
        let sums = match lighting {
            Lighting::Apart => {
                let LightIndex(picture) = contribution.light;
                if !self.touched.contains(&picture) {
                    self.touched.push(picture);
                }
                &mut self.sums[picture]
            }
            Lighting::Mixed(_) => self.of_light(contribution.light),
        };
        sums.iter_mut().zip(values).for_each(|(sum, value)| add(sum, value, 1.0));
    }

    fn of_light(&mut self, light: LightIndex) -> &mut [[f64; 3]; K] {
        let known = self.lights.iter().position(|(known, _)| *known == light);
        let at = known.unwrap_or_else(|| {
            self.lights.push((light, [[0.0; 3]; K]));
            self.lights.len() - 1
        });
        &mut self.lights[at].1
    }

    /// Mixes what each light brought to pictures.
    fn mix(&mut self, lighting: &Lighting<'_>, first: usize) {
        let Lighting::Mixed(mixes) = lighting else { return };
        if self.lights.is_empty() {
            return;
        }
        for (picture, sums) in self.sums.iter_mut().enumerate() {
            self.touched.push(picture);
            for (light, values) in &self.lights {
                for (k, (sum, value)) in sums.iter_mut().zip(values).enumerate() {
                    // Variants beyond the last repeat it.
                    let weight = mixes[(first + k).min(mixes.len() - 1)][picture][light.0];
                    add(sum, from_fn(|channel| value[channel] * weight[channel]), 1.0);
                }
            }
        }
        self.lights.clear();
    }

    fn clear(&mut self) {
        for picture in self.touched.drain(..) {
            self.sums[picture] = [[0.0; 3]; K];
        }
    }
}

impl<const K: usize> Part<K> {
    fn new(window: Window, pictures: usize) -> Self {
        Self { sums: vec![[[0.0; 3]; K]; window.area() * pictures], window }
    }

    /// The index within the rectangle of the pixel that contains (x, y), or `None` outside.
    fn pixel(&self, x: f64, y: f64) -> Option<usize> {
        let (x, y) = (x.floor(), y.floor());
        let holds = |range: &std::ops::Range<i32>, v: f64| v >= f64::from(range.start) && v < f64::from(range.end);
        let Window { columns, rows } = &self.window;
        (holds(columns, x) && holds(rows, y))
            .then(|| (y as i32 - rows.start) as usize * self.window.width() + (x as i32 - columns.start) as usize)
    }

    fn add(&mut self, pixel: usize, found: &PathLight<K>, weight: f64) {
        let first = pixel * found.sums.len();
        for &picture in &found.touched {
            let pairs = self.sums[first + picture].iter_mut().zip(found.sums[picture]);
            pairs.for_each(|(sum, value)| add(sum, value, weight));
        }
    }

    /// Adds the rectangle to its view. A pixel receives few rectangles, always in the order of the tiles.
    fn merge_into(&self, films: &mut [LightBasis]) {
        for (k, film) in films.iter_mut().enumerate() {
            let pictures = film.pictures().len();
            for (place, [x, y]) in self.window.cells().enumerate() {
                let (x, y) = (x as usize, y as usize);
                for (at, picture) in film.pictures_mut().iter_mut().enumerate() {
                    let mut pixel = picture.get(x, y);
                    let sum = self.sums[place * pictures + at][k];
                    pixel.0.iter_mut().zip(sum).for_each(|(pixel, sum)| *pixel += sum as f32);
                    picture.set(x, y, pixel);
                }
            }
        }
    }
}

fn add(sum: &mut [f64; 3], value: [f64; 3], weight: f64) {
    for channel in 0..3 {
        sum[channel] += weight * value[channel];
    }
}

/// The block of each pixel of each view. Pixels of one block, in any view, may share paths.
///
/// Cameras that share a centre share paths: a path goes into every view that holds its direction. Blocks are then
/// squares of `side` pixels of the image plane of the first of them; a pixel belongs to the block that its centre lies
/// in. Other cameras have blocks of their own.
pub fn noise_blocks(cameras: &[Camera], side: u32) -> Vec<Picture<u64>> {
    let groups = groups_with_one_centre(cameras);
    let of_view = |(view, camera): (usize, &Camera)| {
        let group = groups.iter().position(|group| group.contains(&view)).expect("every view is in a group");
        let first = &cameras[groups[group][0]];
        let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
        Picture::from_fn(width, height, |x, y| {
            let direction = camera.direction(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
            (group as u64) << 32 | u64::from(block(first, direction, side))
        })
    };
    cameras.iter().enumerate().map(of_view).collect()
}

/// Row and column of a block, 16 bits each, counted from far above and left of the picture.
fn block(first: &Camera, direction: DVec3, side: u32) -> u32 {
    let local = first.rotation().transpose() * direction;
    let k = first.intrinsics;
    let at = DVec2::new(k.cx - k.fx * local.x / local.z, k.cy + k.fy * local.y / local.z);
    let step = |value: f64| ((value / f64::from(side)).floor() + 32768.0).clamp(0.0, 65535.0) as u32;
    step(at.y) << 16 | step(at.x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_scale_groups_by_channel() {
        let flat = |value: f32| Picture::filled(2, 1, LinearRgb([value; 3]));
        let basis = LightBasis::new(2, 1, vec![flat(1.0), flat(2.0)]).unwrap();
        let mixed = basis.weighted(&[[1.0, 0.0, 0.5], [0.0, 2.0, 0.5]]).unwrap();
        assert_eq!(mixed.get(1, 0), LinearRgb([1.0, 4.0, 1.5]));
        assert_eq!(basis.sum(), basis.weighted(&[[1.0; 3]; 2]).unwrap());
        assert!(basis.weighted(&[[1.0; 3]]).is_err());
        assert!(LightBasis::new(1, 1, vec![flat(1.0)]).is_err());
    }
}
