//! Search for the place of a donor's surface that is nearest to a given place.

use glam::DVec3;
use mateval_scene::triangle::nearest_weights;
use rstar::{AABB, PointDistance, RTree, RTreeObject};

use super::donor::Donor;

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
    /// Index of the triangle.
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

    use super::super::donor::DonorTriangle;
    use super::*;

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
