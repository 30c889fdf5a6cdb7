//! Transfers a donor's materials to an instance's atlas: each place of a texel takes the material of the nearest place
//! of the donor's surface.

use glam::DVec3;
use mateval_dataset::mesh::nearest_weights;
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_image::Picture;
use rayon::prelude::*;
use rstar::{AABB, PointDistance, RTree, RTreeObject};

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
    /// Smallest distance between a texel and the donor, in metres; absent if the donor has no triangles.
    pub nearest_m: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distances {
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

/// Among places at most this much further away than the nearest, one that faces the same way is preferred, because the
/// two sides of a board may lie closer together than two meshes of the board do.
const SAME_SHEET_M: f64 = 1e-3;
/// Largest number of places that are compared in this way.
const MOST_COMPARED: usize = 64;

/// A donor's triangles in a tree for nearest-place queries.
pub struct Correspondence {
    tree: RTree<Leaf>,
}

/// A place of a donor's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corresponding {
    pub triangle: usize,
    /// Barycentric weights of the place, with sum 1.
    pub weights: DVec3,
    /// Distance from the query's place, in metres.
    pub distance_m: f64,
}

struct Leaf {
    corners: [DVec3; 3],
    normal: DVec3,
    triangle: usize,
}

impl Leaf {
    fn corresponding(&self, place: DVec3) -> Corresponding {
        let weights = nearest_weights(self.corners, place);
        let distance_m = self.place(weights).distance(place);
        Corresponding { triangle: self.triangle, weights, distance_m }
    }

    fn place(&self, weights: DVec3) -> DVec3 {
        let [a, b, c] = self.corners;
        a * weights.x + b * weights.y + c * weights.z
    }
}

impl RTreeObject for Leaf {
    type Envelope = AABB<[f64; 3]>;

    fn envelope(&self) -> Self::Envelope {
        let [a, b, c] = self.corners;
        AABB::from_corners(a.min(b).min(c).to_array(), a.max(b).max(c).to_array())
    }
}

impl PointDistance for Leaf {
    fn distance_2(&self, point: &[f64; 3]) -> f64 {
        let place = DVec3::from(*point);
        self.place(nearest_weights(self.corners, place)).distance_squared(place)
    }
}

impl Correspondence {
    /// Builds the tree of those triangles of the donor whose index `is_included` accepts.
    pub fn new(donor: &Donor, is_included: impl Fn(usize) -> bool) -> Self {
        let numbers = (0..donor.triangles.len()).filter(|triangle| is_included(*triangle));
        Self::of_triangles(numbers.map(|triangle| (triangle, donor.corners(triangle))))
    }

    /// Builds the tree of these triangles, each with its index.
    pub fn of_triangles(triangles: impl Iterator<Item = (usize, [DVec3; 3])>) -> Self {
        let leaf = |(triangle, corners): (usize, [DVec3; 3])| {
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            Leaf { corners, normal, triangle }
        };
        Self { tree: RTree::bulk_load(triangles.map(leaf).collect()) }
    }

    /// The distance of the nearest place, in the unit of the triangles; `None` where the tree is empty.
    pub fn distance(&self, place: DVec3) -> Option<f64> {
        Some(self.tree.nearest_neighbor(&place.to_array())?.corresponding(place).distance_m)
    }

    /// The nearest place; among nearly equal distances, a place that faces as `normal` does. `None` where the tree is
    /// empty.
    pub fn nearest(&self, place: DVec3, normal: DVec3) -> Option<Corresponding> {
        let mut leaves = self.tree.nearest_neighbor_iter(&place.to_array()).take(MOST_COMPARED).peekable();
        let nearest = leaves.peek()?.corresponding(place).distance_m;
        let near = leaves.map(|leaf| (leaf, leaf.corresponding(place)));
        let near = near.take_while(|(_, found)| found.distance_m <= nearest + SAME_SHEET_M);
        let key =
            |(leaf, found): &(&Leaf, Corresponding)| (leaf.normal.dot(normal) <= 0.0, found.distance_m, leaf.triangle);
        let order = |a: &(bool, f64, usize), b: &(bool, f64, usize)| {
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
        };
        near.min_by(|a, b| order(&key(a), &key(b))).map(|(_, found)| found)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::import::donor::DonorTriangle;

    fn donor(triangles: &[[Vec3; 3]]) -> Donor {
        let triangle = |corners: &[Vec3; 3]| DonorTriangle {
            corners: *corners,
            uvs: Default::default(),
            colors: [Vec3::ONE; 3],
            is_painted: false,
            material: 0,
        };
        Donor { triangles: triangles.iter().map(triangle).collect(), ..Donor::default() }
    }

    #[test]
    fn the_side_that_faces_the_same_way_is_preferred() {
        let front = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let back = [Vec3::ZERO, Vec3::Y, Vec3::X].map(|corner| corner - Vec3::Z * 5e-4);
        let far = [Vec3::ZERO, Vec3::Y, Vec3::X].map(|corner| corner - Vec3::Z * 5e-3);
        let place = DVec3::new(0.2, 0.2, 0.0);
        let tree = Correspondence::new(&donor(&[front, back]), |_| true);
        assert_eq!(tree.nearest(place, DVec3::Z).unwrap().triangle, 0);
        assert_eq!(tree.nearest(place, -DVec3::Z).unwrap().triangle, 1);
        // Twin: the other side is too far away to belong to the same board.
        let tree = Correspondence::new(&donor(&[front, far]), |_| true);
        assert_eq!(tree.nearest(place, -DVec3::Z).unwrap().triangle, 0);
        assert!(Correspondence::new(&donor(&[front]), |_| false).nearest(place, DVec3::Z).is_none());
    }
}
