//! Which instance each pixel of an estimate shows.

use glam::{DVec2, DVec3};
use mateval_image::Picture;
use mateval_scene::Camera;
use mateval_tracer::aov::{SUBPIXELS, hit_through, subpixels};
use rayon::prelude::*;

use crate::geometry::SceneGeometry;

/// No instance.
const NOBODY: u16 = u16::MAX;

/// What a pixel shows most of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Owner {
    instance: u16,
    /// Whether all of the pixel shows it.
    whole: bool,
}

/// A point of a surface that a pixel shows.
#[derive(Clone, Copy, Debug)]
pub struct SeenPoint {
    /// Whose surface.
    pub instance: usize,
    /// Column and row.
    pub pixel: (usize, usize),
    /// World space, metres.
    pub place: DVec3,
    /// Of the triangle, unit length.
    pub normal: DVec3,
}

/// Which instance each pixel of a picture shows, at the picture's own size.
///
/// Only valid pixels count. A pixel on the edge between two instances shows a mixture of both, which is the colour of
/// neither: it counts only for instances that no pixel shows whole.
pub struct SeenPixels {
    /// The camera at the picture's size.
    pub camera: Camera,
    owners: Picture<Owner>,
    /// For each instance: whether a pixel shows it whole.
    has_whole: Vec<bool>,
}

impl SeenPixels {
    /// Looks through 16 places of every pixel of a picture of the input view of `size` columns and rows.
    pub fn new(geometry: &SceneGeometry<'_>, (width, height): (usize, usize)) -> Self {
        let camera = geometry.view.camera.resized(width as u32, height as u32);
        let rows: Vec<Vec<Owner>> =
            (0..height).into_par_iter().map(|y| (0..width).map(|x| owner(geometry, &camera, x, y)).collect()).collect();
        let owners = Picture::from_fn(width, height, |x, y| rows[y][x]);
        let mut has_whole = vec![false; geometry.scene.instances.len()];
        for owner in owners.pixels().iter().filter(|owner| owner.whole && owner.instance != NOBODY) {
            has_whole[usize::from(owner.instance)] = true;
        }
        Self { camera, owners, has_whole }
    }

    /// Whether the pixel tells what the instance looks like.
    pub fn tells_of(&self, instance: usize, x: usize, y: usize) -> bool {
        let owner = self.owners.get(x, y);
        usize::from(owner.instance) == instance && (owner.whole || !self.has_whole[instance])
    }

    /// Every pixel that tells of an instance as a point of its surface: the one seen nearest to the pixel's centre.
    pub fn points(&self, geometry: &SceneGeometry<'_>) -> Vec<SeenPoint> {
        let telling: Vec<(usize, usize, usize)> = self.telling().collect();
        let point = |(x, y, instance): (usize, usize, usize)| {
            let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let mut places = subpixels(x, y);
            places.sort_by(|a, b| a.distance_squared(centre).total_cmp(&b.distance_squared(centre)));
            let hits = std::iter::once(centre).chain(places);
            let mut hits = hits.filter_map(|place| hit_through(&geometry.world, &self.camera, place));
            let hit = hits.find(|hit| hit.surface.0 == instance)?;
            let corners = geometry.mesh(instance).corners(hit.triangle).map(|corner| corner.as_dvec3());
            let weights = hit.barycentrics.as_dvec3();
            let place = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
            let normal = geometry.mesh(instance).geometric_normal(hit.triangle);
            Some(SeenPoint { instance, pixel: (x, y), place, normal })
        };
        telling.into_par_iter().filter_map(point).collect()
    }

    /// Every pixel that tells of an instance, with it.
    pub fn telling(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        let (width, height) = (self.owners.width(), self.owners.height());
        let places = (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
        places.filter_map(|(x, y)| {
            let instance = usize::from(self.owners.get(x, y).instance);
            (instance < self.has_whole.len() && self.tells_of(instance, x, y)).then_some((x, y, instance))
        })
    }
}

/// The pixel of the input view that holds the centre of a pixel of the same picture at `camera`'s size.
pub(crate) fn view_pixel(geometry: &SceneGeometry<'_>, camera: &Camera, x: usize, y: usize) -> (usize, usize) {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    ((2 * x + 1) * geometry.valid.width() / (2 * width), (2 * y + 1) * geometry.valid.height() / (2 * height))
}

fn owner(geometry: &SceneGeometry<'_>, camera: &Camera, x: usize, y: usize) -> Owner {
    let nobody = Owner { instance: NOBODY, whole: false };
    let of_view = view_pixel(geometry, camera, x, y);
    if !geometry.valid.get(of_view.0, of_view.1) {
        return nobody;
    }
    let hits = subpixels(x, y).map(|place| hit_through(&geometry.world, camera, place).map(|hit| hit.surface.0));
    let count = |instance: usize| hits.iter().filter(|hit| **hit == Some(instance)).count();
    let Some((most, instance)) = hits.iter().flatten().map(|&instance| (count(instance), instance)).max() else {
        return nobody;
    };
    let whole = most == SUBPIXELS;
    // Where the whole pixel shows another instance than the dataset's own picture, a cut-out texel was looked through.
    let shown = geometry.instances.get(of_view.0, of_view.1);
    if whole && geometry.scene.instances[instance].index.0.get() != shown {
        return nobody;
    }
    Owner { instance: instance as u16, whole }
}
