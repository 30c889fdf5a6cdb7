//! The input camera of a scene, as a recipe states it.

use serde::Deserialize;

use super::limits::FARTHEST_M;

/// The input camera of a scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "CameraWords")]
pub enum RecipeCamera {
    /// Placed by hand.
    Given(GivenCamera),
    /// Found by drawing cameras in the room until one sees enough. The same seed finds the same camera.
    Seed {
        /// The seed of the draw.
        seed: u64,
        /// Vertical field of view in degrees; if absent, that of the recipe's camera rules.
        fov_y_deg: Option<f64>,
    },
    /// A designer's camera, by its number. It keeps its field of view.
    Designer(usize),
}

/// A camera that was placed by hand.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenCamera {
    /// Its position, in metres.
    pub position: [f64; 3],
    /// A point in the middle of the picture, in metres.
    pub target: [f64; 3],
    /// Vertical field of view in degrees.
    pub fov_y_deg: f64,
}

/// A camera's keys as they are in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraWords {
    position: Option<[f64; 3]>,
    target: Option<[f64; 3]>,
    fov_y_deg: Option<f64>,
    seed: Option<u64>,
    designer: Option<usize>,
}

/// The keys of a camera fit together in none of the three ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "camera: expected {{ position, target, fov_y_deg }}, {{ seed }} (with or without fov_y_deg), or {{ designer }}"
)]
struct UnfitKeys;

impl TryFrom<CameraWords> for RecipeCamera {
    type Error = UnfitKeys;

    fn try_from(words: CameraWords) -> Result<Self, UnfitKeys> {
        match words {
            CameraWords {
                position: Some(position),
                target: Some(target),
                fov_y_deg: Some(fov_y_deg),
                seed: None,
                designer: None,
            } => Ok(Self::Given(GivenCamera { position, target, fov_y_deg })),
            CameraWords { position: None, target: None, fov_y_deg, seed: Some(seed), designer: None } => {
                Ok(Self::Seed { seed, fov_y_deg })
            }
            CameraWords { position: None, target: None, fov_y_deg: None, seed: None, designer: Some(number) } => {
                Ok(Self::Designer(number))
            }
            _ => Err(UnfitKeys),
        }
    }
}

impl RecipeCamera {
    /// Whether coordinates and field of view are in range.
    pub(super) fn is_in_range(&self) -> bool {
        let has_sound_field = |fov_y_deg: f64| fov_y_deg > 0.0 && fov_y_deg < 179.0;
        match self {
            Self::Given(camera) => {
                let mut coordinates = camera.position.iter().chain(&camera.target);
                coordinates.all(|v| v.abs() <= FARTHEST_M) && has_sound_field(camera.fov_y_deg)
            }
            Self::Seed { fov_y_deg, .. } => fov_y_deg.is_none_or(has_sound_field),
            Self::Designer(_) => true,
        }
    }
}
