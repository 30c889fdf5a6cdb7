//! A donor's materials in an instance's atlas: each place of a texel takes what the nearest place of the donor says.

use glam::DVec3;
use mateval_image::Picture;
use mateval_scene::uv_atlas::UvAtlas;
use rayon::prelude::*;

use super::correspondence::Correspondence;
use super::donor::Donor;
use crate::estimate::Values;
use crate::geometry::SceneGeometry;
use crate::lift::{PartialAtlas, Texel, mean, places_of, texel_size_m};

/// Most places along a texel's side.
const MAX_PLACES: f64 = 8.0;
/// By so much the donor may be finer than the atlas and count as equally fine.
const A_LITTLE: f64 = 0.1;

/// An atlas, and how it came to be.
pub struct Rebaked {
    /// Unseen: nothing of the donor is near enough.
    pub atlas: PartialAtlas,
    /// Of all places that were found, in metres.
    pub distances: Distances,
    /// The nearest that the donor comes to any texel; none where it has no triangles.
    pub nearest_m: Option<f64>,
}

/// Distances, gathered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distances {
    /// How many.
    pub count: usize,
    /// In metres.
    pub sum: f64,
    /// In metres.
    pub max: f64,
}

struct RebakedTexel {
    texel: Texel,
    distances: Distances,
    nearest_m: f64,
}

/// Fills the atlas of one instance, `size` texels a side; places further away than `max_distance_m` are not taken.
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
        // One place where the donor is no finer than the atlas: more would only blur it.
        let centre = places_of(&atlas, mesh, (x, y), 1)[0];
        let found = correspondence.nearest(centre, normal);
        let finer =
            found.map_or(1.0, |found| texel_size_m(&atlas, mesh, triangle) / donor.texel_size_m(found.triangle));
        let a_side = (finer - A_LITTLE).ceil().clamp(1.0, MAX_PLACES) as usize;
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
    let (mut said, mut distances, mut nearest_m) = (Vec::<Values>::new(), Distances::default(), f64::INFINITY);
    for found in places.iter().filter_map(|place| correspondence.nearest(*place, normal)) {
        nearest_m = nearest_m.min(found.distance_m);
        if found.distance_m <= max_distance_m {
            distances.count += 1;
            distances.sum += found.distance_m;
            distances.max = distances.max.max(found.distance_m);
            said.push(donor.values(found.triangle, found.weights));
        }
    }
    RebakedTexel { texel: mean(&said).map_or(Texel::Unseen, Texel::Seen), distances, nearest_m }
}
