//! An estimate of the input view written into an instance's atlas, where the view shows the instance.

use glam::{DVec2, DVec3};
use mateval_image::Picture;
use mateval_scene::TriangleMesh;
use mateval_scene::camera::Projection;
use mateval_scene::uv_atlas::UvAtlas;
use mateval_tracer::Ray;
use rayon::prelude::*;

use crate::estimate::{Estimate, Values};
use crate::geometry::SceneGeometry;
use crate::seen::SeenPixels;

/// Most places along a texel's side: a texel that covers more pixels is undersampled.
const MAX_PLACES: f64 = 16.0;
/// A texel's place is seen where the ray from the camera ends on its instance no further from it than this share of the
/// distance. The ray is what decides; this only tells two sheets of one instance apart.
const SAME_PLACE: f64 = 2e-4;

/// What is known of a texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Texel {
    /// No triangle looks it up.
    Unused,
    /// The input view does not show it.
    Unseen,
    /// The mean of the estimate over what the input view shows of the texel's square.
    Seen(Values),
}

/// An instance's atlas, as far as the input view tells.
pub struct PartialAtlas {
    /// Which triangle each texel belongs to.
    pub atlas: UvAtlas,
    /// What is known.
    pub texels: Picture<Texel>,
}

/// Writes the estimate into the atlas of one instance, `size` texels a side.
pub fn lift(
    geometry: &SceneGeometry<'_>,
    seen: &SeenPixels,
    estimate: &Estimate,
    instance: usize,
    size: usize,
) -> PartialAtlas {
    let mesh = geometry.mesh(instance);
    let atlas = UvAtlas::new(mesh, size);
    let lifter = Lifter {
        geometry,
        seen,
        estimate,
        instance,
        mesh,
        atlas: &atlas,
        origin: seen.camera.position(),
        projection: seen.camera.projection(),
        focal: seen.camera.intrinsics.fx.max(seen.camera.intrinsics.fy),
    };
    let rows: Vec<Vec<Texel>> =
        (0..size).into_par_iter().map(|y| (0..size).map(|x| lifter.texel(x, y)).collect()).collect();
    let texels = Picture::new(size, size, rows.into_iter().flatten().collect()).expect("a row of texels for every row");
    PartialAtlas { atlas, texels }
}

/// The place of a texel's centre on the surface: its triangle's nearest point for a texel beside it.
pub fn place_of(atlas: &UvAtlas, mesh: &TriangleMesh, triangle: usize, place: DVec2) -> DVec3 {
    let weights = atlas.nearest_barycentrics(triangle, place);
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    a * weights.x + b * weights.y + c * weights.z
}

/// How many metres a texel's side covers in a triangle.
pub fn texel_size_m(atlas: &UvAtlas, mesh: &TriangleMesh, triangle: usize) -> f64 {
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    let area = (b - a).cross(c - a).length() / 2.0;
    (area / atlas.texel_area(triangle).max(1e-12)).sqrt()
}

/// `a_side` times `a_side` places of an owned texel's square, those of its triangle alone, or the centre where that has
/// none of them; of a texel beside its triangle the triangle's nearest. None for a texel that nobody owns.
pub fn places_of(atlas: &UvAtlas, mesh: &TriangleMesh, (x, y): (usize, usize), a_side: usize) -> Vec<DVec3> {
    let Some((triangle, inside)) = atlas.owner(x, y) else { return Vec::new() };
    let corner = DVec2::new(x as f64, y as f64);
    let within = |at: usize| DVec2::new((at % a_side) as f64 + 0.5, (at / a_side) as f64 + 0.5) / a_side as f64;
    let squares = (0..a_side * a_side).map(|at| corner + within(at));
    // Another triangle has what lies beside; a texel beside its triangle has no place inside.
    let is_own = |place: &DVec2| !inside || atlas.barycentrics(triangle, *place).min_element() >= -1e-9;
    let mut own: Vec<DVec2> = squares.filter(is_own).collect();
    if own.is_empty() {
        own.push(corner + 0.5);
    }
    own.into_iter().map(|place| place_of(atlas, mesh, triangle, place)).collect()
}

/// The mean of each number; none of nothing.
pub fn mean(all: &[Values]) -> Option<Values> {
    let count = all.len() as f64;
    let sum = |channel: usize| all.iter().map(|values| f64::from(values[channel])).sum::<f64>();
    (!all.is_empty()).then(|| std::array::from_fn(|channel| (sum(channel) / count) as f32))
}

struct Lifter<'a> {
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

impl Lifter<'_> {
    fn texel(&self, x: usize, y: usize) -> Texel {
        let Some((triangle, _)) = self.atlas.owner(x, y) else { return Texel::Unused };
        let centre = DVec2::new(x as f64, y as f64) + 0.5;
        let places = places_of(self.atlas, self.mesh, (x, y), self.places_a_side(triangle, centre));
        let said: Vec<Values> = places.into_iter().filter_map(|place| self.look(place)).collect();
        mean(&said).map_or(Texel::Unseen, Texel::Seen)
    }

    /// So many that neighbours lie half a pixel apart at most.
    fn places_a_side(&self, triangle: usize, centre: DVec2) -> usize {
        let texel_m = texel_size_m(self.atlas, self.mesh, triangle);
        let distance = place_of(self.atlas, self.mesh, triangle, centre).distance(self.origin).max(1e-6);
        (2.0 * self.focal * texel_m / distance).ceil().clamp(1.0, MAX_PLACES) as usize
    }

    /// What the estimate says of a place of the instance, where the camera sees it.
    fn look(&self, place: DVec3) -> Option<Values> {
        let (pixel, _) = self.projection.project(place)?;
        if !self.seen.camera.holds(pixel) {
            return None;
        }
        let (x, y) = (pixel.x as usize, pixel.y as usize);
        if !self.seen.tells_of(self.instance, x, y) {
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
