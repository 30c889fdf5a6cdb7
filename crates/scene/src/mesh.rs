//! Triangle meshes in world space.

use glam::{DVec3, Vec2, Vec3};

/// Triangles in world space (metres, +Y up). Optional arrays have one entry for each position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions.
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
    pub fn corners(&self, index: usize) -> [Vec3; 3] {
        self.triangles[index].map(|vertex| self.positions[vertex as usize])
    }

    /// The unit normal of triangle `index`, on the side where it is counter-clockwise; zero for a triangle without
    /// area.
    pub fn geometric_normal(&self, index: usize) -> DVec3 {
        let [a, b, c] = self.corners(index).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).normalize_or_zero()
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
        (0..self.triangles.len())
            .map(|index| {
                let [a, b, c] = self.corners(index).map(|p| p.as_dvec3());
                (b - a).cross(c - a).length() / 2.0
            })
            .sum()
    }
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
}
