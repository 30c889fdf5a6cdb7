//! The camera model: a pinhole without distortion, with one matrix for every picture of a view.

use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Focal lengths and principal point in pixels; pixel centres at +0.5, origin at the top left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Intrinsics {
    /// Number of columns of the picture.
    pub width: u32,
    /// Number of rows of the picture.
    pub height: u32,
    /// Focal length along rows, in pixels.
    pub fx: f64,
    /// Focal length along columns, in pixels.
    pub fy: f64,
    /// Column of the principal point, in pixels from the left edge.
    pub cx: f64,
    /// Row of the principal point, in pixels from the top edge.
    pub cy: f64,
}

impl Intrinsics {
    /// Intrinsics with square pixels and the principal point in the middle; `fov_y` in radians.
    pub fn from_fov_y(width: u32, height: u32, fov_y: f64) -> Self {
        Self::centred(width, height, f64::from(height) / 2.0 / libm::tan(fov_y / 2.0))
    }

    /// Intrinsics with square pixels and the principal point in the middle; `fov_x` in radians.
    pub fn from_fov_x(width: u32, height: u32, fov_x: f64) -> Self {
        Self::centred(width, height, f64::from(width) / 2.0 / libm::tan(fov_x / 2.0))
    }

    fn centred(width: u32, height: u32, focal: f64) -> Self {
        Self { width, height, fx: focal, fy: focal, cx: f64::from(width) / 2.0, cy: f64::from(height) / 2.0 }
    }
}

/// A pinhole camera that looks along its -Z, +Y up, +X right (OpenGL's and Blender's axes).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Row-major 4x4; a rotation and a translation in metres.
    pub world_from_camera: [[f64; 4]; 4],
    /// Focal lengths and principal point, in pixels.
    pub intrinsics: Intrinsics,
}

/// A camera with its inverse matrix, for projecting many points.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    camera_from_world: DMat4,
    intrinsics: Intrinsics,
}

impl Projection {
    /// See [`Camera::project`].
    pub fn project(&self, world: DVec3) -> Option<(DVec2, f64)> {
        let camera: DVec4 = self.camera_from_world * world.extend(1.0);
        let depth = -camera.z;
        let k = &self.intrinsics;
        (depth > 0.0).then(|| (DVec2::new(k.cx + k.fx * camera.x / depth, k.cy - k.fy * camera.y / depth), depth))
    }
}

impl Camera {
    /// A camera at `position` that looks at `target`, with its X axis perpendicular to `up`.
    pub fn look_at(position: DVec3, target: DVec3, up: DVec3, intrinsics: Intrinsics) -> Option<Self> {
        let back = (position - target).try_normalize()?;
        let right = up.cross(back).try_normalize()?;
        let rotation = DMat3::from_cols(right, back.cross(right), back);
        Some(Self::from_rotation(rotation, position, intrinsics))
    }

    /// A camera at `position` with this rotation from camera to world.
    pub fn from_rotation(rotation: DMat3, position: DVec3, intrinsics: Intrinsics) -> Self {
        let matrix = DMat4::from_cols(
            rotation.x_axis.extend(0.0),
            rotation.y_axis.extend(0.0),
            rotation.z_axis.extend(0.0),
            position.extend(1.0),
        );
        Self { world_from_camera: matrix.transpose().to_cols_array_2d(), intrinsics }
    }

    pub fn moved(mut self, by: DVec3) -> Self {
        self.world_from_camera.iter_mut().zip(by.to_array()).for_each(|(row, by)| row[3] += by);
        self
    }

    pub fn matrix(&self) -> DMat4 {
        DMat4::from_cols_array_2d(&self.world_from_camera).transpose()
    }

    pub fn rotation(&self) -> DMat3 {
        DMat3::from_mat4(self.matrix())
    }

    pub fn position(&self) -> DVec3 {
        self.matrix().w_axis.truncate()
    }

    /// The camera turned by `x_deg` about its own X, then `y_deg` about its own Y: `R_new = R * Rx(dx) * Ry(dy)`, the
    /// translation kept.
    pub fn turned(&self, x_deg: f64, y_deg: f64) -> Self {
        let turn = rotation_x(x_deg.to_radians()) * rotation_y(y_deg.to_radians());
        Self::from_rotation(self.rotation() * turn, self.position(), self.intrinsics)
    }

    /// The unit direction in world space through the point `pixel` of the picture.
    pub fn direction(&self, pixel: DVec2) -> DVec3 {
        (self.rotation() * self.camera_direction(pixel)).normalize()
    }

    /// The direction in camera space through `pixel`, with z = -1; multiplied by a depth it is a point in camera space.
    pub fn camera_direction(&self, pixel: DVec2) -> DVec3 {
        let k = &self.intrinsics;
        DVec3::new((pixel.x - k.cx) / k.fx, -(pixel.y - k.cy) / k.fy, -1.0)
    }

    /// The world point seen at `pixel` at `depth` metres along the camera's axis.
    pub fn unproject(&self, pixel: DVec2, depth: f64) -> DVec3 {
        self.matrix().transform_point3(self.camera_direction(pixel) * depth)
    }

    /// The position of a world point in the picture, and its depth along the camera's axis in metres; none behind the
    /// camera.
    pub fn project(&self, world: DVec3) -> Option<(DVec2, f64)> {
        self.projection().project(world)
    }

    /// The depth of a point along the camera's axis, in metres, or `None` if it is not in front of the camera.
    pub fn depth(&self, world: DVec3) -> Option<f64> {
        let depth = (self.position() - world).dot(self.rotation().z_axis);
        (depth > 0.0).then_some(depth)
    }

    pub fn projection(&self) -> Projection {
        Projection { camera_from_world: self.matrix().inverse(), intrinsics: self.intrinsics }
    }

    /// The same camera with a picture of `width` times `height` pixels.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let whole = DVec2::new(f64::from(self.intrinsics.width), f64::from(self.intrinsics.height));
        self.cropped(DVec2::ZERO, whole, width, height)
    }

    /// The same camera with a picture of `width` times `height` pixels that shows a rectangle of the present picture:
    /// `corner` is its upper left corner and `size` its width and height, both in pixels of the present picture.
    pub fn cropped(&self, corner: DVec2, size: DVec2, width: u32, height: u32) -> Self {
        let k = &self.intrinsics;
        let (x, y) = (f64::from(width) / size.x, f64::from(height) / size.y);
        let (cx, cy) = ((k.cx - corner.x) * x, (k.cy - corner.y) * y);
        Self { intrinsics: Intrinsics { width, height, fx: k.fx * x, fy: k.fy * y, cx, cy }, ..*self }
    }

    /// Whether the point `pixel` lies in the picture.
    pub fn holds(&self, pixel: DVec2) -> bool {
        let k = &self.intrinsics;
        pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < f64::from(k.width) && pixel.y < f64::from(k.height)
    }
}

fn rotation_x(angle: f64) -> DMat3 {
    let (sin, cos) = libm::sincos(angle);
    DMat3::from_cols(DVec3::X, DVec3::new(0.0, cos, sin), DVec3::new(0.0, -sin, cos))
}

fn rotation_y(angle: f64) -> DMat3 {
    let (sin, cos) = libm::sincos(angle);
    DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        let intrinsics = Intrinsics::from_fov_x(480, 270, 1.2);
        Camera::look_at(DVec3::new(1.0, 1.6, 2.0), DVec3::new(-1.0, 1.2, -2.0), DVec3::Y, intrinsics).unwrap()
    }

    #[test]
    fn project_undoes_unproject() {
        let pixel = DVec2::new(13.25, 201.5);
        let place = camera().unproject(pixel, 2.5);
        let (back, depth) = camera().project(place).unwrap();
        assert!((back - pixel).length() < 1e-9 && (depth - 2.5).abs() < 1e-12);
        assert!((camera().depth(place).unwrap() - 2.5).abs() < 1e-12);
    }

    #[test]
    fn behind_the_camera_is_nowhere() {
        let camera = camera();
        let behind = camera.position() + camera.rotation().z_axis;
        assert!(camera.project(behind).is_none() && camera.depth(behind).is_none());
    }

    /// +x looks up and +y looks left, as the names of the views say.
    #[test]
    fn plus_five_plus_five_looks_up_and_left() {
        let level = Camera::look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y, Intrinsics::from_fov_x(64, 64, 1.0)).unwrap();
        let centre = level.turned(5.0, 5.0).direction(DVec2::new(32.0, 32.0));
        assert!(centre.y > 0.08 && centre.x < -0.08, "{centre}");
    }
}
