//! Writes an estimate of the input view into the texels of an instance's atlas that the view shows.

use glam::{DVec2, DVec3};
use mateval_dataset::TriangleMesh;
use mateval_dataset::camera::Projection;
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_image::Picture;
use mateval_tracer::Ray;
use rayon::prelude::*;

use crate::estimate::{Estimate, Values};
use crate::geometry::{SceneGeometry, SeenPixels};

/// Largest number of places along a texel's side; a texel that covers more pixels is undersampled.
const MAX_PLACES: f64 = 16.0;
/// A place of a texel is seen if the ray from the camera hits its instance at the place's distance, up to this share of
/// it. The tolerance only has to separate two sheets of the same instance.
const SAME_PLACE: f64 = 2e-4;

/// What the input view shows of a texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Texel {
    /// The texel belongs to no triangle.
    Unused,
    /// The input view does not show the texel.
    Unseen,
    /// The mean of the estimate over the part of the texel that the input view shows.
    Seen(Values),
}

impl Texel {
    pub fn seen(self) -> Option<Values> {
        if let Self::Seen(values) = self { Some(values) } else { None }
    }
}

/// An instance's atlas with the texels that are known.
pub struct PartialAtlas {
    /// The triangle that each texel belongs to.
    pub atlas: UvAtlas,
    pub texels: Picture<Texel>,
}

/// Writes the estimate into the atlas of one instance, which has `size` x `size` texels.
pub fn lift(
    geometry: &SceneGeometry<'_>,
    seen: &SeenPixels,
    estimate: &Estimate,
    instance: usize,
    size: usize,
) -> PartialAtlas {
    let atlas = UvAtlas::new(geometry.mesh(instance), size);
    let lifter = Lifter::new(geometry, seen, estimate, instance, &atlas);
    // An atlas has up to 16 million texels, so it is filled in place.
    let mut texels = Picture::filled(size, size, Texel::Unused);
    texels.pixels_mut().par_chunks_mut(size).enumerate().for_each(|(y, row)| lifter.row(y, row));
    PartialAtlas { atlas, texels }
}

/// The surface point at `place` in the atlas, in world space; for a place outside the triangle, the triangle's nearest
/// point in the atlas.
pub fn place_of(atlas: &UvAtlas, mesh: &TriangleMesh, triangle: usize, place: DVec2) -> DVec3 {
    let weights = atlas.nearest_barycentrics(triangle, place);
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    a * weights.x + b * weights.y + c * weights.z
}

/// The side of a texel on a triangle, in metres.
pub fn texel_size_m(atlas: &UvAtlas, mesh: &TriangleMesh, triangle: usize) -> f64 {
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    let area = (b - a).cross(c - a).length() / 2.0;
    (area / atlas.texel_area(triangle).max(1e-12)).sqrt()
}

/// Surface points of a texel: of `per_side` x `per_side` places in its square those inside its triangle, or its centre
/// if none is. A texel whose centre lies outside its triangle gets the triangle's nearest points. Empty for a texel
/// without a triangle.
pub fn places_of(atlas: &UvAtlas, mesh: &TriangleMesh, (x, y): (usize, usize), per_side: usize) -> Vec<DVec3> {
    let Some((triangle, inside)) = atlas.owner(x, y) else { return Vec::new() };
    let corner = DVec2::new(x as f64, y as f64);
    let within = |at: usize| DVec2::new((at % per_side) as f64 + 0.5, (at / per_side) as f64 + 0.5) / per_side as f64;
    let squares = (0..per_side * per_side).map(|at| corner + within(at));
    // Places outside belong to another triangle, unless the texel's centre itself lies outside.
    let is_own = |place: &DVec2| !inside || atlas.barycentrics(triangle, *place).min_element() >= -1e-9;
    let mut own: Vec<DVec2> = squares.filter(is_own).collect();
    if own.is_empty() {
        own.push(corner + 0.5);
    }
    own.into_iter().map(|place| place_of(atlas, mesh, triangle, place)).collect()
}

/// The mean of each value; none for no entries.
pub fn mean(all: &[Values]) -> Option<Values> {
    let count = all.len() as f64;
    let sum = |channel: usize| all.iter().map(|values| f64::from(values[channel])).sum::<f64>();
    (!all.is_empty()).then(|| std::array::from_fn(|channel| (sum(channel) / count) as f32))
}

/// Lifts an estimate to the atlas of one instance, row by row.
pub(crate) struct Lifter<'a> {
    geometry: &'a SceneGeometry<'a>,
    seen: &'a SeenPixels,
    estimate: &'a Estimate,
    instance: usize,
    mesh: &'a TriangleMesh,
    atlas: &'a UvAtlas,
    origin: DVec3,
    projection: Projection,
    focal: f64,
}

impl<'a> Lifter<'a> {
    pub(crate) fn new(
        geometry: &'a SceneGeometry<'a>,
        seen: &'a SeenPixels,
        estimate: &'a Estimate,
        instance: usize,
        atlas: &'a UvAtlas,
    ) -> Self {
        Self {
            geometry,
            seen,
            estimate,
            instance,
            mesh: geometry.mesh(instance),
            atlas,
            origin: seen.camera.position(),
            projection: seen.camera.projection(),
            focal: seen.camera.intrinsics.fx.max(seen.camera.intrinsics.fy),
        }
    }

    /// Writes what the input view shows of the texels of row `y`.
    pub(crate) fn row(&self, y: usize, row: &mut [Texel]) {
        // Neighbours mostly belong to one triangle, whose texels have one size.
        let mut before: Option<(usize, f64)> = None;
        for (x, texel) in row.iter_mut().enumerate() {
            *texel = match self.atlas.owner(x, y) {
                None => Texel::Unused,
                Some((triangle, _)) => {
                    let known = before.filter(|(same, _)| *same == triangle);
                    let texel_m = known.map_or_else(|| texel_size_m(self.atlas, self.mesh, triangle), |known| known.1);
                    before = Some((triangle, texel_m));
                    self.texel((x, y), triangle, texel_m)
                }
            };
        }
    }

    /// What the input view shows of a texel. `texel_m` is the side of its triangle's texels, in metres.
    fn texel(&self, (x, y): (usize, usize), triangle: usize, texel_m: f64) -> Texel {
        let centre = place_of(self.atlas, self.mesh, triangle, DVec2::new(x as f64, y as f64) + 0.5);
        let distance = centre.distance(self.origin).max(1e-6);
        // Neighbouring places are then at most half a pixel apart.
        let places_per_side = (2.0 * self.focal * texel_m / distance).ceil().clamp(1.0, MAX_PLACES) as usize;
        if places_per_side == 1 {
            return self.estimate_at(centre).map_or(Texel::Unseen, Texel::Seen);
        }
        let places = places_of(self.atlas, self.mesh, (x, y), places_per_side);
        let values: Vec<Values> = places.into_iter().filter_map(|place| self.estimate_at(place)).collect();
        mean(&values).map_or(Texel::Unseen, Texel::Seen)
    }

    /// The estimate at a place of the instance, if the camera sees it.
    fn estimate_at(&self, place: DVec3) -> Option<Values> {
        let (pixel, _) = self.projection.project(place)?;
        if !self.seen.camera.holds(pixel) {
            return None;
        }
        let (x, y) = (pixel.x as usize, pixel.y as usize);
        if !self.seen.shows(self.instance, x, y) {
            return None;
        }
        let way = place - self.origin;
        let distance = way.length();
        let ray = Ray::endless(self.origin.as_vec3(), (way / distance).as_vec3());
        let hit = self.geometry.world.first_hit(&ray)?;
        let is_here =
            hit.surface.0 == self.instance && (f64::from(hit.distance) - distance).abs() <= SAME_PLACE * distance;
        is_here.then(|| self.estimate.at(x, y))
    }
}
