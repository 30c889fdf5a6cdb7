//! The part of a protocol that says where lights stand and how their radiances are fitted.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the lights of a stage are; metres. Ours: nobody has published theirs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageRules {
    /// About the side of a ceiling cell; cells fill the rectangle that is seen from the camera at its height.
    pub cell_m: f64,
    /// The side of a cell's light over the cell's own.
    pub cell_share: f64,
    /// How far ceiling lights hang under the ceiling.
    pub ceiling_gap_m: f64,
    /// The side of the light behind the camera.
    pub camera_side_m: f64,
    /// How far behind the camera it stands.
    pub camera_distance_m: f64,
    /// Width and height of a wall's light over the wall's own.
    pub wall_share: f64,
    /// How far wall lights stand before their wall.
    pub wall_gap_m: f64,
    /// Plane pieces of the architecture narrower or lower than this are no walls.
    pub least_wall_m: f64,
}

impl Default for StageRules {
    /// What every protocol has today.
    fn default() -> Self {
        Self {
            cell_m: 1.0,
            cell_share: 0.5,
            ceiling_gap_m: 1e-3,
            camera_side_m: 1.5,
            camera_distance_m: 0.5,
            wall_share: 0.8,
            wall_gap_m: 1e-3,
            least_wall_m: 0.5,
        }
    }
}

/// How radiances are fitted to the input view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitRules {
    /// Pixels along the side of the squares that are averaged.
    pub pool: u32,
    /// Samples a pixel of the light basis that the fit is made on; a stream of its own.
    pub samples: u32,
    /// Radiances one of which the fit starts from: the one whose picture with grey materials is nearest by luminance.
    pub start_radiances: Vec<f64>,
    /// Base colour, linear, of those grey materials.
    pub start_grey: f32,
    /// Samples a pixel of that picture: few, since the start does not move where the fit ends.
    pub start_samples: u32,
}
