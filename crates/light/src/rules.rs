//! The part of a protocol that defines where lights stand and how their radiances are fitted.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the lights of a stage are; lengths in metres. PSDR-Room's values are not published; these are MatEval's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageRules {
    /// Number of horizontal directions along which the extent of the room is measured from the camera.
    pub extent_directions: u32,
    /// Approximate side of a ceiling cell. Cells fill the rectangle that the camera sees at its own height.
    pub cell_m: f64,
    /// Side of a cell's light, as a share of the cell's side.
    pub cell_share: f64,
    /// Distance from the ceiling down to its lights.
    pub ceiling_gap_m: f64,
    /// Side of the light behind the camera.
    pub camera_side_m: f64,
    /// Distance from the camera back to that light.
    pub camera_distance_m: f64,
    /// Width and height of a wall's light, as a share of the wall's own.
    pub wall_share: f64,
    /// Distance from a wall to its light.
    pub wall_gap_m: f64,
    /// Connected pieces of the architecture that are narrower or lower than this are not walls.
    pub least_wall_m: f64,
    /// A wall's visibility is tested at a grid of places, with this many along each side.
    pub wall_samples: u32,
    /// Sine of the largest angle between a ceiling's normal and the vertical, and between a wall's normal and the
    /// horizontal, and between the normals of one wall's triangles and of its largest one.
    pub upright_sine: f64,
    /// The largest distance of a wall's corners from the plane of its largest triangle, and the largest gap within that plane
    /// between connected triangles.
    pub same_plane_m: f64,
    /// A place is visible if nothing is nearer to the camera than the place by more than this.
    pub visible_within_m: f64,
}

impl Default for StageRules {
    /// The values of every protocol today.
    fn default() -> Self {
        Self {
            extent_directions: 64,
            cell_m: 1.0,
            cell_share: 0.5,
            ceiling_gap_m: 1e-3,
            camera_side_m: 1.5,
            camera_distance_m: 0.5,
            wall_share: 0.8,
            wall_gap_m: 1e-3,
            least_wall_m: 0.5,
            wall_samples: 16,
            upright_sine: 0.05,
            same_plane_m: 0.01,
            visible_within_m: 2e-3,
        }
    }
}

/// How radiances are fitted to the input view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitRules {
    /// Side of the squares of pixels whose averages are compared, at least 1.
    pub pool: u32,
    /// Samples per pixel of the light bases that the fit is made on, half of them for each of two independent streams.
    pub samples: u32,
    /// The factor of the ridge towards the start, above 0: the share of the photo's light that all lights at twice their
    /// start add to the objective.
    pub ridge: f64,
}

impl Default for FitRules {
    /// The values of every protocol today.
    fn default() -> Self {
        Self { pool: 8, samples: 8, ridge: 1e-2 }
    }
}
