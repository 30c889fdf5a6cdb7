//! The data of a triangle that shading reads, in one record: a hit touches two cache lines instead of twelve.

use glam::{DVec3, Vec2, Vec3};
use mateval_scene::TriangleMesh;

use crate::accel::TriangleIndex;

/// 2^-24, half the spacing of f32 at 1.
pub(crate) const ROUNDING: f32 = 1.0 / (1 << 24) as f32;

/// The corners of a triangle and what is constant over it: 128 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct TriangleRecord {
    pub(crate) positions: [Vec3; 3],
    /// [`crate::SurfaceHit::geometric_normal`].
    pub(crate) normal: Vec3,
    /// The distance from the triangle at which rays start so that they do not hit it again, in metres.
    pub(crate) offset: f32,
    /// Zero if the mesh has no uvs.
    pub(crate) uvs: [Vec2; 3],
    /// Vertex normals, if `smooth`.
    pub(crate) normals: [Vec3; 3],
    pub(crate) smooth: bool,
}

impl TriangleRecord {
    /// The record of a triangle of `mesh`. `scene_size` is the largest absolute coordinate of the scene.
    pub(crate) fn new(mesh: &TriangleMesh, triangle: TriangleIndex, scene_size: f32) -> Self {
        let vertices = mesh.triangles[triangle.0].map(|vertex| vertex as usize);
        let positions = mesh.corners(triangle.0);
        let [a, b, c] = positions.map(|corner| corner.as_dvec3());
        let by_winding = (b - a).cross(c - a).try_normalize().unwrap_or(DVec3::Z).as_vec3();
        let normals = mesh.normals.as_ref().map(|normals| vertices.map(|vertex| normals[vertex]));
        let turned = normals.is_some_and(|normals| normals.into_iter().sum::<Vec3>().dot(by_winding) < 0.0);
        Self {
            positions,
            normal: if turned { -by_winding } else { by_winding },
            offset: offset(positions, scene_size),
            uvs: mesh.uvs.as_ref().map_or([Vec2::ZERO; 3], |uvs| vertices.map(|vertex| uvs[vertex])),
            smooth: normals.is_some(),
            normals: normals.unwrap_or_default(),
        }
    }
}

/// A hit is off its triangle by 6 roundings of the corners' coordinates (3 of the weights, 3 of their sum), times the
/// square root of 3 where the triangle is oblique. The next ray's triangle test moves corners by 6 roundings of
/// distances of up to twice the coordinates, along two axes. The sum rounds once per axis. Together that is 10.4 + 17 +
/// 1.7 roundings; 40 leaves a margin. The second term is for a neighbour in the same plane, which may be as large as
/// the scene.
fn offset(corners: [Vec3; 3], scene_size: f32) -> f32 {
    let largest = corners.iter().fold(0.0_f32, |size, corner| size.max(corner.abs().max_element()));
    ROUNDING * (40.0 * largest + 4.0 * scene_size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_fills_two_cache_lines() {
        assert_eq!((size_of::<TriangleRecord>(), align_of::<TriangleRecord>()), (128, 64));
    }
}
