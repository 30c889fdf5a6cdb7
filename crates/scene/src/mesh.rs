//! Triangle meshes in world space.

use glam::{Vec2, Vec3};

/// Triangles in world space (metres, +Y up). Vertex arrays, where present, have one entry a position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Shading normals of unit length, or none: then the geometric normal serves.
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
