//! What replaces a map that is missing or unusable, as the format promises.

use mateval_scene::submission::{GREY, Map};

/// The perceptual roughness that replaces a missing map.
pub const MISSING_ROUGHNESS: f32 = 0.5;

/// The metallic that replaces a missing map.
pub const MISSING_METALLIC: f32 = 0.0;

/// The linear value of the map that replaces a missing one, in all channels.
pub fn default_value(map: Map) -> f32 {
    match map {
        Map::BaseColor => GREY,
        Map::Roughness => MISSING_ROUGHNESS,
        Map::Metallic => MISSING_METALLIC,
    }
}
