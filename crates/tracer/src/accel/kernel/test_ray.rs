//! A ray in the form that the box test and the triangle tests use, computed once per ray.

use crate::ray::Ray;

/// The values of a ray for the box test.
pub(crate) struct BoxRay {
    /// For each axis, which corner of a box is nearer: 0 the lower, 1 the upper.
    pub(super) near: [usize; 3],
    pub(super) inverse: [f32; 3],
    /// The padded origins times the inverse directions.
    pub(super) near_origin: [f32; 3],
    pub(super) far_origin: [f32; 3],
}

const PADDING: f32 = 1.0 / (1 << 20) as f32;
/// The factor by which the interval of a box test is widened.
pub(crate) const WIDENED: f32 = 1.0 + 1.0 / (1 << 21) as f32;
/// Smaller direction components are raised to this in the slab test: over a kilometre that moves the ray by 1e-17 m.
const SMALLEST_DIRECTION: f32 = 1e-20;

impl BoxRay {
    /// `scene_size` is the largest absolute coordinate of the scene.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, scene_size: f32) -> Self {
        let origin = ray.origin().to_array();
        let pad = (scene_size + 2.0 * ray.origin().abs().max_element()) * PADDING;
        let mut slab = Self { near: [0; 3], inverse: [0.0; 3], near_origin: [0.0; 3], far_origin: [0.0; 3] };
        for (axis, d) in ray.direction().to_array().into_iter().enumerate() {
            let inverse = 1.0 / d.abs().max(SMALLEST_DIRECTION).copysign(d);
            let signed_pad = pad.copysign(d);
            slab.near[axis] = usize::from(d < 0.0);
            slab.inverse[axis] = inverse;
            slab.near_origin[axis] = (origin[axis] + signed_pad) * inverse;
            slab.far_origin[axis] = (origin[axis] - signed_pad) * inverse;
        }
        slab
    }
}

/// The values of a ray for the triangle tests.
pub(crate) struct TriangleRay {
    pub(super) origin: [f32; 3],
    pub(super) direction: [f32; 3],
    /// The axes that become x, y, z of the sheared space; z is the axis along which the direction is largest.
    pub(super) axes: [usize; 3],
    pub(super) shear: [f32; 2],
    /// One over the direction's component along z.
    pub(super) distance_from_z: f32,
}

impl TriangleRay {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, boxes: &BoxRay) -> Self {
        let d = ray.direction().to_array();
        let [along_x, along_y, along_z] = d.map(f32::abs);
        let z = if along_x > along_y.max(along_z) { 0 } else { 2 - usize::from(along_y > along_z) };
        let (x, y) = ([1, 2, 0][z], [2, 0, 1][z]);
        // The largest component of a unit vector is never below `SMALLEST_DIRECTION`.
        let distance_from_z = boxes.inverse[z];
        Self {
            origin: ray.origin().to_array(),
            direction: d,
            axes: [x, y, z],
            shear: [d[x] * distance_from_z, d[y] * distance_from_z],
            distance_from_z,
        }
    }
}
