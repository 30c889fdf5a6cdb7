//! Triangle meshes in world space, and the point of a triangle that is nearest to a given point.

use glam::{DVec3, Vec2, Vec3};

/// Triangles in world space (metres, +Y up). Optional arrays have one entry for each position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    pub positions: Vec<Vec3>,
    /// Shading normals of unit length; without them the geometric normal is used.
    pub normals: Option<Vec<Vec3>>,
    /// Texture coordinates, origin at the lower left, v upwards (OBJ's convention, not glTF's).
    pub uvs: Option<Vec<Vec2>>,
    /// Three vertex indices a triangle; counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// The corners of triangle `index`; panics where there is no such triangle.
    #[inline]
    pub fn corners(&self, index: usize) -> [Vec3; 3] {
        self.triangles[index].map(|vertex| self.positions[vertex as usize])
    }

    /// The uv at a place of triangle `index` with these barycentric weights; absent without uvs.
    #[inline]
    pub fn uv_at(&self, index: usize, weights: Vec3) -> Option<Vec2> {
        let uvs = self.uvs.as_deref()?;
        let [a, b, c] = self.triangles[index].map(|vertex| uvs[vertex as usize]);
        Some(a * weights.x + b * weights.y + c * weights.z)
    }

    /// The unit normal of triangle `index`, on the side where it is counter-clockwise; zero for a triangle without
    /// area.
    pub fn geometric_normal(&self, index: usize) -> DVec3 {
        let [a, b, c] = self.corners(index).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Adds a copy of a vertex. Returns its index.
    pub fn copy_vertex(&mut self, vertex: u32) -> u32 {
        let at = vertex as usize;
        self.positions.push(self.positions[at]);
        self.normals.iter_mut().for_each(|normals| normals.push(normals[at]));
        self.uvs.iter_mut().for_each(|uvs| uvs.push(uvs[at]));
        self.positions.len() as u32 - 1
    }

    /// Appends another mesh. Where only one of them has uvs, the other's are zero; normals are kept if both have them.
    pub fn append(&mut self, other: &Self) {
        let first = self.positions.len();
        if self.uvs.is_some() || other.uvs.is_some() {
            let uvs = self.uvs.get_or_insert_with(|| vec![Vec2::ZERO; first]);
            match &other.uvs {
                Some(others) => uvs.extend_from_slice(others),
                None => uvs.resize(first + other.positions.len(), Vec2::ZERO),
            }
        }
        self.normals = match (self.normals.take(), &other.normals) {
            (Some(mut normals), Some(others)) => {
                normals.extend_from_slice(others);
                Some(normals)
            }
            (None, Some(others)) if first == 0 => Some(others.clone()),
            _ => None,
        };
        self.positions.extend_from_slice(&other.positions);
        self.triangles.extend(other.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first as u32)));
    }

    /// The triangles whose index `belongs` accepts, in their order, with the vertices that they use.
    pub fn picked(&self, belongs: impl Fn(usize) -> bool) -> Self {
        let mut new_place = vec![u32::MAX; self.positions.len()];
        let mut used = Vec::new();
        let mut triangles = Vec::new();
        for triangle in (0..self.triangles.len()).filter(|triangle| belongs(*triangle)) {
            triangles.push(self.triangles[triangle].map(|vertex| {
                let place = &mut new_place[vertex as usize];
                if *place == u32::MAX {
                    *place = used.len() as u32;
                    used.push(vertex as usize);
                }
                *place
            }));
        }
        Self {
            positions: used.iter().map(|vertex| self.positions[*vertex]).collect(),
            normals: self.normals.as_ref().map(|all| used.iter().map(|vertex| all[*vertex]).collect()),
            uvs: self.uvs.as_ref().map(|all| used.iter().map(|vertex| all[*vertex]).collect()),
            triangles,
        }
    }

    /// The sum of the triangles' areas, in square metres.
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|index| self.triangle_area(index)).sum()
    }

    /// In square metres.
    pub fn triangle_area(&self, index: usize) -> f64 {
        let [a, b, c] = self.corners(index).map(|p| p.as_dvec3());
        (b - a).cross(c - a).length() / 2.0
    }
}

/// The least and the greatest corner of the points' bounding box; absent without points.
pub fn bounds(points: impl Iterator<Item = Vec3>) -> Option<[Vec3; 2]> {
    points.map(|point| [point; 2]).reduce(|[low, high], [point, _]| [low.min(point), high.max(point)])
}

/// The barycentric weights of the triangle's point nearest to `point`; they are not negative and add to one. A triangle
/// without area counts as its edges.
pub fn nearest_weights(corners: [DVec3; 3], point: DVec3) -> DVec3 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared();
    let across = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal);
    let weights = DVec3::new(across(b, c), across(c, a), across(a, b)) / area;
    if area > 0.0 && weights.min_element() >= 0.0 {
        return weights / weights.element_sum();
    }
    nearest_on_edges(corners, point).weights
}

/// The distance from `point` to the nearest point of the triangle.
pub fn triangle_distance(corners: [DVec3; 3], point: DVec3) -> f64 {
    let [a, b, c] = corners;
    let weights = nearest_weights(corners, point);
    (a * weights.x + b * weights.y + c * weights.z).distance(point)
}

/// A point on an edge of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EdgePoint {
    pub(crate) point: DVec3,
    /// Its barycentric weights; one of them is 0.
    weights: DVec3,
}

/// The point of the triangle's edges nearest to `point`: the nearest of the triangle for every point beside it
/// (Ericson, "Real-Time Collision Detection", 2005, section 5.1.5). Of equally near ones that of the earlier edge.
pub(crate) fn nearest_on_edges([a, b, c]: [DVec3; 3], point: DVec3) -> EdgePoint {
    let edges = [(a, b, DVec3::X, DVec3::Y), (b, c, DVec3::Y, DVec3::Z), (c, a, DVec3::Z, DVec3::X)];
    let on_edges = edges.map(|(from, to, first, second)| {
        let along = to - from;
        let share = ((point - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        EdgePoint { point: from + along * share, weights: first.lerp(second, share) }
    });
    let apart = |candidate: &EdgePoint| candidate.point.distance_squared(point);
    on_edges.into_iter().min_by(|x, y| apart(x).total_cmp(&apart(y))).expect("a triangle has three edges")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(at: f32) -> TriangleMesh {
        TriangleMesh {
            positions: [Vec3::ZERO, Vec3::X, Vec3::Y].map(|corner| corner + at).into(),
            triangles: vec![[0, 1, 2]],
            ..Default::default()
        }
    }

    #[test]
    fn what_was_put_together_is_picked_apart() {
        let with_uvs = TriangleMesh { uvs: Some(vec![Vec2::ONE; 3]), ..triangle(5.0) };
        let mut both = TriangleMesh::default();
        both.append(&triangle(0.0));
        both.append(&with_uvs);
        assert_eq!(both.corners(1), with_uvs.corners(0));
        assert_eq!(both.uvs.as_ref().map(|uvs| (uvs[2], uvs[3])), Some((Vec2::ZERO, Vec2::ONE)));
        assert_eq!(both.picked(|index| index == 1), with_uvs);
        assert_eq!(both.picked(|_| true), both);
        assert!(both.picked(|_| false).positions.is_empty());
    }

    #[test]
    fn normals_of_one_alone_are_dropped() {
        let with_normals = TriangleMesh { normals: Some(vec![Vec3::Z; 3]), ..triangle(0.0) };
        let mut mesh = TriangleMesh::default();
        mesh.append(&with_normals);
        mesh.append(&with_normals);
        assert_eq!(mesh.normals.as_ref().map(Vec::len), Some(6));
        mesh.append(&triangle(1.0));
        assert_eq!(mesh.normals, None);
    }

    fn random_point(next: &mut u64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| {
            *next += 1;
            (crate::splitmix64::number(1, *next) >> 40) as f64 / f64::from(1 << 24) * 2.0 - 0.5
        }))
    }

    /// Against a fine net of the triangle's points.
    #[test]
    fn no_point_of_the_triangle_is_nearer() {
        let mut next = 0;
        for _ in 0..50 {
            let corners = std::array::from_fn(|_| random_point(&mut next));
            let point = random_point(&mut next);
            let at = |weights: DVec3| corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
            let weights = nearest_weights(corners, point);
            assert!(weights.min_element() >= 0.0 && (weights.element_sum() - 1.0).abs() < 1e-12);
            let found = at(weights).distance(point);
            assert_eq!(found, triangle_distance(corners, point));
            let net = (0..=60).flat_map(|i| (0..=60 - i).map(move |j| (i, j)));
            let best = net.map(|(i, j)| at(DVec3::new(f64::from(i), f64::from(j), f64::from(60 - i - j)) / 60.0));
            let best = best.map(|point_of_net| point_of_net.distance(point)).fold(f64::INFINITY, f64::min);
            assert!(found <= best + 1e-12 && found >= best - 0.05, "{found} {best}");
        }
    }

    #[test]
    fn triangles_without_area_have_a_nearest_point() {
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        let weights = nearest_weights(line, DVec3::new(1.5, 1.0, 0.0));
        assert_eq!(line[1] * weights.y + line[2] * weights.z, DVec3::X * 1.5);
        let dot = nearest_weights([DVec3::ONE; 3], DVec3::ZERO);
        assert!((dot.element_sum() - 1.0).abs() < 1e-12 && dot.is_finite());
    }
}
