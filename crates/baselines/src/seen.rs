//! Which instance each pixel of an estimate shows, and where on its surface.

use glam::{DVec2, DVec3};
use mateval_image::Picture;
use mateval_scene::Camera;
use mateval_tracer::aov::{COARSE_SUBPIXELS, coarse_subpixels, hit_through};
use rayon::prelude::*;

use crate::geometry::SceneGeometry;
use crate::placement::Region;

/// Marks pixels that show no instance.
const NO_INSTANCE: u16 = u16::MAX;

/// The instance that covers most of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Owner {
    instance: u16,
    /// Whether the instance covers the whole pixel.
    whole: bool,
}

/// The surface point that a pixel shows.
#[derive(Clone, Copy, Debug)]
pub struct SeenPoint {
    /// Index of the instance.
    pub instance: usize,
    /// Column and row of the pixel.
    pub pixel: (usize, usize),
    /// World space, in metres.
    pub place: DVec3,
    /// Normal of the triangle, of unit length.
    pub normal: DVec3,
}

/// Which instance each pixel of a picture shows, at the picture's own size.
///
/// Only valid pixels count. A pixel on the edge between two instances mixes the colours of both, so it counts only for
/// instances that cover no whole pixel.
pub struct SeenPixels {
    /// The camera whose picture this is.
    pub camera: Camera,
    /// The part of the view that the picture shows.
    region: Region,
    owners: Picture<Owner>,
    /// For each instance, whether it covers a whole pixel.
    has_whole: Vec<bool>,
}

impl SeenPixels {
    /// Traces 16 rays through every pixel of the input view at this width and height.
    pub fn new(geometry: &SceneGeometry<'_>, size: (usize, usize)) -> Self {
        Self::of_region(geometry, size, Region::whole((geometry.valid.width(), geometry.valid.height())))
    }

    /// The same for a picture of this width and height that shows a part of the input view.
    pub fn of_region(geometry: &SceneGeometry<'_>, (width, height): (usize, usize), region: Region) -> Self {
        let camera = geometry.view.camera.cropped(region.corner, region.size, width as u32, height as u32);
        let rows: Vec<Vec<Owner>> = (0..height)
            .into_par_iter()
            .map(|y| (0..width).map(|x| owner(geometry, &camera, region, x, y)).collect())
            .collect();
        let owners = Picture::from_fn(width, height, |x, y| rows[y][x]);
        let mut has_whole = vec![false; geometry.scene.instances.len()];
        for owner in owners.pixels().iter().filter(|owner| owner.whole && owner.instance != NO_INSTANCE) {
            has_whole[usize::from(owner.instance)] = true;
        }
        Self { camera, region, owners, has_whole }
    }

    /// Whether the pixel's colour is that of the instance.
    pub fn shows(&self, instance: usize, x: usize, y: usize) -> bool {
        let owner = self.owners.get(x, y);
        usize::from(owner.instance) == instance && (owner.whole || !self.has_whole[instance])
    }

    /// The surface point of every pixel that shows an instance: the one nearest to the pixel's centre.
    pub fn points(&self, geometry: &SceneGeometry<'_>) -> Vec<SeenPoint> {
        let shown: Vec<(usize, usize, usize)> = self.shown_pixels().collect();
        let point = |(x, y, instance): (usize, usize, usize)| {
            let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let mut places = coarse_subpixels(x, y);
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
        shown.into_par_iter().filter_map(point).collect()
    }

    /// The pixel of the input view that contains the centre of pixel (`x`, `y`).
    pub fn view_pixel(&self, x: usize, y: usize) -> (usize, usize) {
        view_pixel(self.region, (self.owners.width(), self.owners.height()), x, y)
    }

    /// Column, row and instance of every pixel that shows an instance.
    pub fn shown_pixels(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        let (width, height) = (self.owners.width(), self.owners.height());
        let places = (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
        places.filter_map(|(x, y)| {
            let instance = usize::from(self.owners.get(x, y).instance);
            (instance < self.has_whole.len() && self.shows(instance, x, y)).then_some((x, y, instance))
        })
    }
}

/// The pixel of the input view that contains the centre of pixel (`x`, `y`) of a picture.
fn view_pixel(region: Region, size: (usize, usize), x: usize, y: usize) -> (usize, usize) {
    let place = region.place(size, x, y);
    (place.x as usize, place.y as usize)
}

fn owner(geometry: &SceneGeometry<'_>, camera: &Camera, region: Region, x: usize, y: usize) -> Owner {
    let none = Owner { instance: NO_INSTANCE, whole: false };
    let size = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let of_view = view_pixel(region, size, x, y);
    if !geometry.valid.get(of_view.0, of_view.1) {
        return none;
    }
    let hits = coarse_subpixels(x, y).map(|place| hit_through(&geometry.world, camera, place).map(|hit| hit.surface.0));
    let count = |instance: usize| hits.iter().filter(|hit| **hit == Some(instance)).count();
    let Some((most, instance)) = hits.iter().flatten().map(|&instance| (count(instance), instance)).max() else {
        return none;
    };
    let whole = most == COARSE_SUBPIXELS;
    // The dataset's own picture shows another instance where the ray hit a cut-out texel, which does not cover it.
    let shown = geometry.instances.get(of_view.0, of_view.1);
    if whole && geometry.scene.instances[instance].index.0.get() != shown {
        return none;
    }
    Owner { instance: instance as u16, whole }
}
