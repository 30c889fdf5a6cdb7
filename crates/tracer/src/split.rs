//! A photo's light, split at the surface that each pixel shows.
//!
//! In: a world whose surfaces have one assumed colour each, its possible lights, a camera and the photo that it took.
//! Out, for each pixel and light: the radiance that the pixel's surface would show per unit of base colour
//! ([`SplitLight::diffuse`]), and the radiance that it mirrors whatever its base colour ([`SplitLight::gloss`]). A
//! dielectric surface is affine in its base colour, so that the pixel's radiance is their sum, with the diffuse part
//! times the base colour.
//!
//! The photo is the light cache of all later surfaces (the idea of Yu et al., "Inverse Global Illumination", SIGGRAPH
//! 1999): where a path meets a place that the photo shows, its radiance is read there and the path ends. Such light
//! needs no assumption on colours, and comes as one more picture after those of the lights.

use std::array::from_fn;
use std::sync::{Mutex, PoisonError};

use glam::{DVec2, Vec2, Vec3};
use mateval_dataset::Camera;
use mateval_dataset::camera::Projection;
use mateval_dataset::material::PrincipledFlavour;
use mateval_image::{LinearRgb, Mask, Picture};
use rayon::prelude::*;

use crate::aov::hit_through;
use crate::bsdf::{BlenderTables, Bsdf, Principled, eta_from_specular};
use crate::error::{ExceededLimit, RequestFault, TracerError};
use crate::path::{MaterialSource, PathTracer, RenderSettings};
use crate::ray::{Hit, SurfaceHit};
use crate::render::{Progress, Tile, camera_start, tiles};
use crate::repaint::SPECULAR;
use crate::shared_centre::LightBasis;
use crate::world::World;

/// A photo as a cache of the radiance that leaves the places it shows.
#[derive(Debug)]
pub struct PhotoCache<'a> {
    camera: &'a Camera,
    projection: Projection,
    photo: &'a Picture<LinearRgb>,
    valid: &'a Mask,
    /// The surface and depth of each pixel's centre.
    shown: Vec<Option<(usize, f64)>>,
}

/// How far a place may lie from the depth of its pixel's centre, as a share of it.
const SAME_DEPTH: f64 = 0.02;

impl<'a> PhotoCache<'a> {
    /// The cache of a photo of `world`. Only `valid` pixels are read: their surfaces do not glow. Fails if sizes
    /// differ.
    pub fn new(
        world: &World,
        camera: &'a Camera,
        photo: &'a Picture<LinearRgb>,
        valid: &'a Mask,
    ) -> Result<Self, TracerError> {
        let expected = [camera.intrinsics.width as usize, camera.intrinsics.height as usize];
        for found in [[photo.width(), photo.height()], [valid.width(), valid.height()]] {
            if found != expected {
                return Err(RequestFault::PictureSize { found, expected }.into());
            }
        }
        let [width, height] = expected;
        let shown = |k: usize| {
            let centre = DVec2::new((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
            hit_through(world, camera, centre).map(|hit| (hit.surface.0, hit.depth))
        };
        let shown = (0..width * height).into_par_iter().map(shown).collect();
        Ok(Self { camera, projection: camera.projection(), photo, valid, shown })
    }

    /// The radiance that leaves `place` towards `wo`, as if it left in all directions alike; absent if the photo does
    /// not show that side of the place.
    pub fn radiance(&self, place: &SurfaceHit, wo: Vec3) -> Option<Vec3> {
        let position = place.position.as_dvec3();
        let (at, depth) = self.projection.project(position)?;
        if !self.camera.holds(at) {
            return None;
        }
        let [x, y] = [at.x as usize, at.y as usize];
        let pixel = y * self.photo.width() + x;
        let (surface, seen) = *self.shown.get(pixel)?.as_ref()?;
        let to_camera = (self.camera.position() - position).as_vec3();
        let is_shown = surface == place.surface.0
            && (depth - seen).abs() <= SAME_DEPTH * seen
            && place.is_front(to_camera) == place.is_front(wo)
            && *self.valid.pixels().get(pixel)?;
        is_shown.then(|| Vec3::from_array(self.photo.pixels()[pixel].0))
    }
}

/// What is assumed of the surfaces of a world.
#[derive(Clone, Copy, Debug)]
pub struct AssumedSurfaces<'a> {
    /// The linear base colour of each surface, for paths that have scattered elsewhere before.
    pub colors: &'a [[f32; 3]],
    /// The perceptual roughness of each surface.
    pub roughnesses: &'a [f32],
}

/// The light of a view, apart from the base colours of what it shows. One picture per light group, and one of the light
/// that comes from places in the photo. Pixels that are not valid are black.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitLight {
    /// Radiance per unit of base colour.
    pub diffuse: LightBasis,
    /// Radiance that does not depend on base colour.
    pub gloss: LightBasis,
}

/// The largest size of the pictures together.
const MOST_BYTES: u64 = 1 << 30;

/// The two variants of a pixel's surface: black and white.
const VARIANTS: usize = 2;

/// The surfaces of a world under assumptions: the first one of each path is black and white, all others have their
/// colours.
#[derive(Clone, Copy)]
struct Split<'w> {
    assumed: AssumedSurfaces<'w>,
    cache: &'w PhotoCache<'w>,
    tables: &'w BlenderTables,
}

impl<'w> MaterialSource<'w, VARIANTS> for Split<'w> {
    /// What glows is no Blender lamp but a surface of a room: it also reflects.
    const LAMPS_REFLECT: bool = true;

    fn prefetch(self, _: &Hit) {}

    fn prefetch_texels(self, _: &Hit, _: &SurfaceHit) -> Vec2 {
        Vec2::ZERO
    }

    fn bsdf(self, place: &SurfaceHit, _: Vec2, wo: Vec3, scatterings: u32) -> Bsdf<'w, VARIANTS> {
        let colors = match scatterings {
            0 => [Vec3::ZERO, Vec3::ONE],
            _ => [Vec3::from_array(self.assumed.colors[place.surface.0]); VARIANTS],
        };
        let principled = Principled {
            base_color: colors[0],
            roughness: self.assumed.roughnesses[place.surface.0],
            metallic: 0.0,
            eta: eta_from_specular(SPECULAR),
            style: Principled::style(PrincipledFlavour::Blender, Some(self.tables)),
        };
        Bsdf::of_principled(principled, None, &colors, place, wo)
    }

    fn known_radiance(self, place: &SurfaceHit, wo: Vec3) -> Option<Vec3> {
        self.cache.radiance(place, wo)
    }
}

/// Splits the light of the `wanted` pixels of the cache's view; the others stay black. `progress` is called from any
/// thread with the number of finished tiles and their total.
///
/// The bytes are the same for any number of threads in the current rayon pool. Fails if a setting is out of range, or
/// if `assumed` does not hold one value of each kind for each surface.
pub fn split_light(
    world: &World,
    cache: &PhotoCache<'_>,
    wanted: &Mask,
    assumed: AssumedSurfaces<'_>,
    settings: &RenderSettings,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<SplitLight, TracerError> {
    settings.check()?;
    let expected = world.scene().surfaces.len();
    for found in [assumed.colors.len(), assumed.roughnesses.len()] {
        if found != expected {
            return Err(RequestFault::OtherWorld { found, expected }.into());
        }
    }
    let (width, height) = (cache.photo.width(), cache.photo.height());
    if !wanted.same_size(cache.photo) {
        let found = [wanted.width(), wanted.height()];
        return Err(RequestFault::PictureSize { found, expected: [width, height] }.into());
    }
    let pictures = world.emitters().groups() + 1;
    let bytes = (2 * width * height * size_of::<LinearRgb>()) as u64 * pictures as u64;
    if bytes > MOST_BYTES {
        let pictures = 2 * pictures;
        return Err(ExceededLimit::PictureBytes { pictures, width, height, bytes, limit: MOST_BYTES }.into());
    }
    let tables = BlenderTables::new(eta_from_specular(SPECULAR));
    let split = Split { assumed, cache, tables: &tables };
    let tiles = tiles(width, height);
    let progress = Progress::new(tiles.len(), progress);
    // Each tile is put into the pictures as it is finished: all of them beside the pictures would take as much again.
    let bases: [LightBasis; 2] = from_fn(|_| LightBasis::black(width, height, pictures));
    let bases = Mutex::new(bases);
    tiles.par_iter().for_each(|tile| {
        let means = develop_tile(world, split, wanted, settings, tile, pictures);
        let mut bases = bases.lock().unwrap_or_else(PoisonError::into_inner);
        for (picture, means) in means.into_iter().enumerate() {
            for ([x, y], parts) in tile.pixels().zip(means) {
                for (basis, part) in bases.iter_mut().zip(parts) {
                    basis.pictures_mut()[picture].set(x, y, part);
                }
            }
        }
        drop(bases);
        progress.advance();
    });
    let [diffuse, gloss] = bases.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(SplitLight { diffuse, gloss })
}

/// For each pixel of a tile its diffuse part and its gloss.
type TileMeans = Vec<[LinearRgb; 2]>;

/// The tile in each picture.
fn develop_tile(
    world: &World,
    split: Split<'_>,
    wanted: &Mask,
    settings: &RenderSettings,
    tile: &Tile,
    pictures: usize,
) -> Vec<TileMeans> {
    let camera = split.cache.camera;
    let mut tracer = PathTracer::<_, VARIANTS>::new(world, split, *settings);
    let mut sums = vec![vec![[[0.0_f64; 3]; VARIANTS]; tile.pixels().count()]; pictures];
    let wanted: Vec<(usize, [usize; 2])> = tile.pixels().enumerate().filter(|(_, [x, y])| wanted.get(*x, *y)).collect();
    for index in 0..settings.samples {
        let starts = wanted.iter().map(|&(_, pixel)| camera_start(camera, settings.seed, pixel, index));
        tracer.trace(starts, |start, light, values| {
            let sums = &mut sums[light.0][wanted[start].0];
            for (sum, value) in sums.iter_mut().zip(values) {
                for (channel, value) in sum.iter_mut().zip(value.to_array()) {
                    *channel += f64::from(value);
                }
            }
        });
    }
    let mean = |sum: [f64; 3]| sum.map(|v| v / f64::from(settings.samples));
    let split = |[black, white]: [[f64; 3]; VARIANTS]| {
        let (black, white) = (mean(black), mean(white));
        [LinearRgb(from_fn(|c| (white[c] - black[c]) as f32)), LinearRgb(black.map(|v| v as f32))]
    };
    sums.into_iter().map(|sums| sums.into_iter().map(split).collect()).collect()
}
