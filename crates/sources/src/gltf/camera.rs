//! The camera of a node.

use glam::{DMat3, DMat4};
use mateval_scene::camera::{Camera, Intrinsics};

/// Columns of a picture whose size the recipe does not state; glTF states its shape alone.
const WIDTH: u32 = 480;
/// Width over height where the file does not state it.
const ASPECT: f64 = 16.0 / 9.0;
/// Least and most rows of such a picture.
const HEIGHTS: std::ops::RangeInclusive<f64> = 16.0..=8192.0;

/// The node's camera; none for an orthographic one, one without a field of view, or one that a transform flattens.
pub(super) fn perspective(camera: &gltf::Camera<'_>, world_from_node: DMat4) -> Option<Camera> {
    let gltf::camera::Projection::Perspective(lens) = camera.projection() else { return None };
    let fov_y = f64::from(lens.yfov());
    if !(fov_y > 0.0 && fov_y < std::f64::consts::PI) {
        return None;
    }
    let aspect = lens.aspect_ratio().map_or(ASPECT, f64::from);
    let height = f64::from(WIDTH) / if aspect > 0.0 { aspect } else { ASPECT };
    let height = height.clamp(*HEIGHTS.start(), *HEIGHTS.end()).round() as u32;
    // A camera looks along its -Z with +Y up, as ours does. Scale and shear do not change what it sees.
    let linear = DMat3::from_mat4(world_from_node);
    let back = linear.z_axis.try_normalize()?;
    let right = linear.y_axis.cross(back).try_normalize()?;
    let rotation = DMat3::from_cols(right, back.cross(right), back);
    let position = world_from_node.w_axis.truncate();
    position
        .is_finite()
        .then(|| Camera::from_rotation(rotation, position, Intrinsics::from_fov_y(WIDTH, height, fov_y)))
}
