//! Meshes of floors, walls and fittings, made of rectangles and boxes. Positions and texture coordinates are in metres,
//! as in the data.

use glam::{DVec2, DVec3};

use crate::solid::sides;

#[derive(Clone, Debug)]
pub struct ArchitectureMesh {
    /// The data's type of mesh, as in "WallInner".
    pub kind: &'static str,
    /// The name of its material in `materials`.
    pub material: &'static str,
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
    pub faces: Vec<[usize; 3]>,
}

/// A rectangular hole in a wall, in metres from the wall's start on the floor.
#[derive(Clone, Copy, Debug)]
pub struct WallHole {
    /// Along the wall.
    pub left: f64,
    pub right: f64,
    /// Above the floor.
    pub bottom: f64,
    pub top: f64,
}

impl ArchitectureMesh {
    pub fn new(kind: &'static str, material: &'static str) -> Self {
        Self { kind, material, positions: vec![], normals: vec![], uvs: vec![], faces: vec![] }
    }

    /// Adds a rectangle that spans `right` and `up` from `corner` and faces their cross product. The corner's texture
    /// coordinates are `uv`. The two triangles share no vertices.
    pub fn rectangle(mut self, corner: DVec3, right: DVec3, up: DVec3, uv: DVec2) -> Self {
        let (width, height) = (right.length(), up.length());
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)] {
            self.positions.push(corner + right * u + up * v);
            self.normals.push(right.cross(up).normalize());
            self.uvs.push(uv + DVec2::new(width * u, height * v));
        }
        let first = self.positions.len() - 6;
        self.faces.extend([[first, first + 1, first + 2], [first + 3, first + 4, first + 5]]);
        self
    }

    /// Adds a box between two corners. The two triangles of a side share vertices.
    pub fn boxed(mut self, low: DVec3, high: DVec3) -> Self {
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        for (normal, right, up) in sides() {
            let first = self.positions.len();
            for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                self.positions.push(middle + (normal + right * u + up * v) * half);
                self.normals.push(normal);
                let size = DVec2::new((right * half).length(), (up * half).length());
                self.uvs.push(size * DVec2::new(1.0 + u, 1.0 + v));
            }
            self.faces.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        self
    }

    /// Adds an upright wall that starts at `foot` and runs along `along`, to the right seen from its front. u is measured
    /// from the start, v downwards from the top.
    pub fn wall(self, foot: DVec3, along: DVec3, height: f64, holes: &[WallHole]) -> Self {
        let (length, right) = (along.length(), along.normalize());
        let mut holes = holes.to_vec();
        holes.sort_by(|a, b| a.left.total_cmp(&b.left));
        // The wall is cut into full-height strips between the holes and rectangles below and above each hole.
        let mut pieces = Vec::new();
        let mut from = 0.0;
        for hole in holes {
            pieces.push((from, 0.0, hole.left, height));
            pieces.push((hole.left, 0.0, hole.right, hole.bottom));
            pieces.push((hole.left, hole.top, hole.right, height));
            from = hole.right;
        }
        pieces.push((from, 0.0, length, height));
        pieces.into_iter().filter(|(x0, y0, x1, y1)| x1 > x0 && y1 > y0).fold(self, |wall, (x0, y0, x1, y1)| {
            let corner = foot + right * x0 + DVec3::Y * y0;
            wall.rectangle(corner, right * (x1 - x0), DVec3::Y * (y1 - y0), DVec2::new(x0, y0 - height))
        })
    }

    /// Adds a horizontal rectangle between two corners (x, z) that faces up. u runs along +x, v along -z.
    pub fn facing_up(self, low: DVec2, high: DVec2, y: f64) -> Self {
        let size = high - low;
        let (right, up) = (DVec3::X * size.x, DVec3::NEG_Z * size.y);
        self.rectangle(DVec3::new(low.x, y, high.y), right, up, DVec2::new(0.0, -size.y))
    }

    /// Adds a horizontal rectangle between two corners (x, z) that faces down. u runs along +x, v along +z.
    pub fn facing_down(self, low: DVec2, high: DVec2, y: f64) -> Self {
        let size = high - low;
        let (right, up) = (DVec3::X * size.x, DVec3::Z * size.y);
        self.rectangle(DVec3::new(low.x, y, low.y), right, up, DVec2::new(0.0, -size.y))
    }

    /// Adds the inner sides of a hole through a wall, between two corners, facing into the hole: the left, right and upper
    /// sides and, with `sill`, the lower one. The hole passes through the wall along the shorter of x and z.
    pub fn reveal(mut self, low: DVec3, high: DVec3, sill: bool) -> Self {
        let size = high - low;
        let through_x = size.x < size.z;
        let (middle, half) = ((low + high) / 2.0, size / 2.0);
        for (normal, right, up) in sides() {
            let open = if through_x { normal.x != 0.0 } else { normal.z != 0.0 };
            if open || (normal.y < 0.0 && !sill) {
                continue;
            }
            // `sides` face out of a box; here right and the front are reversed.
            let corner = middle + normal * half + right * half - up * half;
            self = self.rectangle(corner, -right * half * 2.0, up * half * 2.0, DVec2::ZERO);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(mesh: &ArchitectureMesh) -> f64 {
        let p = &mesh.positions;
        mesh.faces.iter().map(|&[a, b, c]| (p[b] - p[a]).cross(p[c] - p[a]).length() / 2.0).sum()
    }

    fn faces_agree_with_normals(mesh: &ArchitectureMesh) -> bool {
        let p = &mesh.positions;
        mesh.faces.iter().all(|&[a, b, c]| (p[b] - p[a]).cross(p[c] - p[a]).dot(mesh.normals[a]) > 0.0)
    }

    #[test]
    fn a_wall_has_the_area_that_its_holes_leave() {
        let holes = [
            WallHole { left: 3.0, right: 3.5, bottom: 0.0, top: 2.0 },
            WallHole { left: 0.5, right: 1.5, bottom: 1.0, top: 2.0 },
        ];
        let wall = ArchitectureMesh::new("WallInner", "paint").wall(DVec3::ZERO, DVec3::X * 4.0, 2.5, &holes);
        assert!((area(&wall) - (10.0 - 1.0 - 1.0)).abs() < 1e-12);
        assert!(faces_agree_with_normals(&wall));
        // u is the distance along the wall and v the height relative to its top, however the wall is cut.
        for (p, uv) in wall.positions.iter().zip(&wall.uvs) {
            assert!((DVec2::new(p.x, p.y - 2.5) - uv).length() < 1e-12);
        }
    }

    #[test]
    fn reveals_face_into_their_hole() {
        let (low, high) = (DVec3::new(1.0, 0.5, 0.0), DVec3::new(2.0, 1.5, 0.2));
        for (sill, rectangles) in [(true, 4), (false, 3)] {
            let reveal = ArchitectureMesh::new("Window", "paint").reveal(low, high, sill);
            assert_eq!(reveal.faces.len(), 2 * rectangles);
            assert!(faces_agree_with_normals(&reveal));
            let middle = (low + high) / 2.0;
            assert!(reveal.positions.iter().zip(&reveal.normals).all(|(p, n)| (middle - p).dot(*n) > 0.0));
        }
    }
}
