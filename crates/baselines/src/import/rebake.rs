//! Transfers a donor's materials to an instance's atlas: each place of a texel takes the material of the nearest place
//! of the donor.

use glam::DVec3;
use mateval_image::Picture;
use mateval_scene::uv_atlas::UvAtlas;
use rayon::prelude::*;

use super::correspondence::Correspondence;
use super::donor::Donor;
use crate::estimate::Values;
use crate::geometry::SceneGeometry;
use crate::lift::{PartialAtlas, Texel, mean, places_of, texel_size_m};

/// Largest number of places along a texel's side.
const MAX_PLACES: f64 = 8.0;
/// A donor whose texels are smaller than the atlas's by up to this share counts as equally fine.
const RESOLUTION_TOLERANCE: f64 = 0.1;

/// An atlas, and how well the donor matched.
pub struct Rebaked {
    /// Texels without a place of the donor near enough are `Unseen`.
    pub atlas: PartialAtlas,
    /// Distances to all places that were used.
    pub distances: Distances,
    /// Smallest distance between a texel and the donor, in metres; none where the donor has no triangles.
    pub nearest_m: Option<f64>,
}

/// A summary of distances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distances {
    /// Number of distances.
    pub count: usize,
    /// Sum, in metres.
    pub sum: f64,
    /// Largest, in metres.
    pub max: f64,
}

struct RebakedTexel {
    texel: Texel,
    distances: Distances,
    nearest_m: f64,
}

/// Fills the atlas of one instance, `size` x `size` texels. Places of the donor further away than `max_distance_m` are
/// not used.
pub fn rebake(
    geometry: &SceneGeometry<'_>,
    instance: usize,
    size: usize,
    donor: &Donor,
    correspondence: &Correspondence,
    max_distance_m: f64,
) -> Rebaked {
    let mesh = geometry.mesh(instance);
    let atlas = UvAtlas::new(mesh, size);
    let look = |at: usize| {
        let (x, y) = (at % size, at / size);
        let unused = RebakedTexel { texel: Texel::Unused, distances: Distances::default(), nearest_m: f64::INFINITY };
        let Some((triangle, _)) = atlas.owner(x, y) else { return unused };
        let normal = mesh.geometric_normal(triangle);
        // Where the donor is no finer than the atlas, one place is enough; more would blur it.
        let centre = places_of(&atlas, mesh, (x, y), 1)[0];
        let found = correspondence.nearest(centre, normal);
        let finer =
            found.map_or(1.0, |found| texel_size_m(&atlas, mesh, triangle) / donor.texel_size_m(found.triangle));
        let a_side = (finer - RESOLUTION_TOLERANCE).ceil().clamp(1.0, MAX_PLACES) as usize;
        texel(donor, correspondence, &places_of(&atlas, mesh, (x, y), a_side), normal, max_distance_m)
    };
    let all: Vec<RebakedTexel> = (0..size * size).into_par_iter().map(look).collect();
    let (mut distances, mut nearest_m) = (Distances::default(), f64::INFINITY);
    for one in &all {
        distances.count += one.distances.count;
        distances.sum += one.distances.sum;
        distances.max = distances.max.max(one.distances.max);
        nearest_m = nearest_m.min(one.nearest_m);
    }
    let nearest_m = nearest_m.is_finite().then_some(nearest_m);
    let texels = all.into_iter().map(|one| one.texel).collect();
    let texels = Picture::new(size, size, texels).expect("a texel for every place");
    Rebaked { atlas: PartialAtlas { atlas, texels }, distances, nearest_m }
}

fn texel(
    donor: &Donor,
    correspondence: &Correspondence,
    places: &[DVec3],
    normal: DVec3,
    max_distance_m: f64,
) -> RebakedTexel {
    let (mut values, mut distances, mut nearest_m) = (Vec::<Values>::new(), Distances::default(), f64::INFINITY);
    for found in places.iter().filter_map(|place| correspondence.nearest(*place, normal)) {
        nearest_m = nearest_m.min(found.distance_m);
        if found.distance_m <= max_distance_m {
            distances.count += 1;
            distances.sum += found.distance_m;
            distances.max = distances.max.max(found.distance_m);
            values.push(donor.values(found.triangle, found.weights));
        }
    }
    RebakedTexel { texel: mean(&values).map_or(Texel::Unseen, Texel::Seen), distances, nearest_m }
}
