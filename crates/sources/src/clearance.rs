//! How far a camera stands from the surfaces of a scene.

use glam::{DVec3, Vec3};
use mateval_scene::reference::ReferenceScene;
use mateval_scene::{TriangleMesh, triangle};

/// The distance in metres to the nearest triangle of the scene, or `enough` where that is smaller.
pub fn distance_to_anything(scene: &ReferenceScene, from: DVec3, enough: f64) -> f64 {
    let from = from.as_vec3();
    let mut nearest = enough as f32;
    for surface in &scene.surfaces {
        nearest = nearest.min(distance_to_mesh(&surface.mesh, from, nearest));
    }
    f64::from(nearest)
}

/// The distance to the nearest point of a mesh, or `enough` where that is smaller.
fn distance_to_mesh(mesh: &TriangleMesh, from: Vec3, enough: f32) -> f32 {
    let mut nearest = enough;
    for index in 0..mesh.triangles.len() {
        let corners = mesh.corners(index);
        // The bounding box excludes most triangles.
        let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        if (from.clamp(low, high) - from).length() < nearest {
            let corners = corners.map(|corner| corner.as_dvec3());
            nearest = nearest.min(triangle::distance(corners, from.as_dvec3()) as f32);
        }
    }
    nearest
}
