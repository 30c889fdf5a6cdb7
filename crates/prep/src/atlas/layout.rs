//! Where the triangles of a shape lie in its atlas, apart from the shape's place in a scene.

use glam::Vec2;
use mateval_scene::TriangleMesh;
use serde::{Deserialize, Serialize};

/// The charts of a shape, packed into a square. It holds for every mesh with the same triangles whose sides have the same
/// lengths, wherever it stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct AtlasLayout {
    /// Texels a side.
    pub(super) size: u32,
    /// Number of charts.
    pub(super) charts: u32,
    /// Number of triangles without a chart, since their area is negligible.
    pub(super) unmapped: usize,
    /// The same triangles in the same order. Vertices are split at the borders of charts.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The shape's vertex of each vertex.
    pub(super) source_vertices: Vec<u32>,
    /// The place of each vertex, 0 to 1, v upwards.
    pub(super) uvs: Vec<[f32; 2]>,
}

/// A mesh with its atlas.
#[derive(Clone, Debug)]
pub struct Unwrapped {
    /// The same triangles in the same order. Vertices are split at the borders of charts; `uvs` are those of the atlas.
    pub mesh: TriangleMesh,
    /// Texels a side.
    pub size: u32,
    /// Number of charts.
    pub charts: u32,
    /// Share of the square that triangles cover, 0 to 1.
    pub coverage: f64,
    /// Length of a texel's side on the surface in metres, averaged over the area.
    pub texel_m: f64,
    /// Number of triangles without a chart, since their area is negligible. All three corners of each lie on one point of
    /// another chart.
    pub unmapped: usize,
}

impl AtlasLayout {
    /// Whether the layout has the mesh's triangles in their order, and places each vertex in the square.
    pub(super) fn belongs_to(&self, mesh: &TriangleMesh) -> bool {
        let source = |vertex: u32| self.source_vertices.get(vertex as usize).copied();
        let is_same = |(own, of_mesh): (&[u32; 3], &[u32; 3])| own.map(source) == of_mesh.map(Some);
        self.uvs.len() == self.source_vertices.len()
            && self.uvs.iter().flatten().all(|value| (0.0..=1.0).contains(value))
            && self.triangles.len() == mesh.triangles.len()
            && self.triangles.iter().zip(&mesh.triangles).all(is_same)
    }

    /// Share of the square that triangles cover, 0 to 1.
    pub(super) fn coverage(&self) -> f64 {
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|vertex| Vec2::from_array(self.uvs[vertex as usize]).as_dvec2());
            ((b - a).perp_dot(c - a) / 2.0).abs()
        };
        self.triangles.iter().map(area).sum()
    }

    /// Length of a texel's side on a mesh of this area, in metres.
    pub(super) fn texel_m(&self, area: f64) -> f64 {
        (area / (self.coverage() * f64::from(self.size) * f64::from(self.size))).sqrt()
    }

    /// The mesh, which has the shape's triangles, with this atlas.
    pub(super) fn unwrapped(&self, mesh: &TriangleMesh) -> Unwrapped {
        let pick = |from: &[glam::Vec3]| self.source_vertices.iter().map(|v| from[*v as usize]).collect::<Vec<_>>();
        Unwrapped {
            mesh: TriangleMesh {
                positions: pick(&mesh.positions),
                normals: mesh.normals.as_deref().map(pick),
                uvs: Some(self.uvs.iter().copied().map(Vec2::from_array).collect()),
                triangles: self.triangles.clone(),
            },
            size: self.size,
            charts: self.charts,
            coverage: self.coverage(),
            texel_m: self.texel_m(mesh.area()),
            unmapped: self.unmapped,
        }
    }
}
