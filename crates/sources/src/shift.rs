//! Moves scenes that lie far from the origin, such as those in map coordinates, near to it before anything becomes f32.

use glam::{DMat4, DVec3};

use crate::log::Log;

/// A scene whose camera stands farther than this from the origin is moved, in metres.
const NEAR_M: f64 = 1000.0;

/// What is subtracted from the positions of a scene with its camera here: whole metres, or nothing near the origin.
///
/// The camera decides, since positions must be exact near it, and a far background does not matter.
pub(crate) fn shift_of(camera: DVec3) -> DVec3 {
    if camera.is_finite() && camera.length() > NEAR_M { camera.round() } else { DVec3::ZERO }
}

/// Reports a shift that is not zero.
pub(crate) fn report(shift: DVec3, log: &mut Log) {
    if shift != DVec3::ZERO {
        let [x, y, z] = shift.to_array();
        let message =
            format!("the scene lies {:.1} km from the origin, where 32 bits are too coarse", shift.length() / 1e3);
        log.note("far_from_origin", "", message, format!("subtracted ({x}, {y}, {z}) m from all positions"));
    }
}

/// The transform that subtracts a shift.
pub(crate) fn transform(shift: DVec3) -> DMat4 {
    if shift == DVec3::ZERO { DMat4::IDENTITY } else { DMat4::from_translation(-shift) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_far_scenes_are_moved_by_whole_metres() {
        assert_eq!(shift_of(DVec3::new(900.5, 0.0, 0.0)), DVec3::ZERO);
        assert_eq!(shift_of(DVec3::new(448_231.25, 120.125, -354_123.5)), DVec3::new(448_231.0, 120.0, -354_124.0));
        assert_eq!(shift_of(DVec3::NAN), DVec3::ZERO);
        assert_eq!(transform(DVec3::ZERO), DMat4::IDENTITY);
    }
}
