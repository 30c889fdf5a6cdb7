//! The camera of a node.

use glam::{DMat3, DMat4};
use mateval_scene::camera::{Camera, Intrinsics};

/// Columns of a picture whose size the recipe does not state; glTF states its shape alone.
const WIDTH: u32 = 480;
/// Width over height where the file does not state it.
const ASPECT: f64 = 16.0 / 9.0;
/// Least and most rows of such a picture.
const HEIGHTS: std::ops::RangeInclusive<f64> = 16.0..=8192.0;

/// Vertical fields of view in radians that a camera may have.
const FIELDS: std::ops::RangeInclusive<f64> = 1e-3..=3.1;
/// Farthest that a camera may stand from the origin along an axis, in metres: there, 64 bits are exact to 0.1 micrometres.
const FARTHEST_M: f64 = 1e9;

/// The node's camera; none for an orthographic one, one of an impossible field of view, one that a transform flattens,
/// and one too far away.
pub(super) fn perspective(camera: &gltf::Camera<'_>, world_from_node: DMat4) -> Option<Camera> {
    let gltf::camera::Projection::Perspective(lens) = camera.projection() else { return None };
    let fov_y = f64::from(lens.yfov());
    if !FIELDS.contains(&fov_y) {
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
    let is_near = position.abs().max_element() <= FARTHEST_M;
    is_near.then(|| Camera::from_rotation(rotation, position, Intrinsics::from_fov_y(WIDTH, height, fov_y)))
}
