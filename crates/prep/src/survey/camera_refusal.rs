//! Why a camera is not offered.

use mateval_sources::front3d::camera_sampler::CameraError;

/// A camera that is not offered, and why.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RefusedCamera {
    /// Where the camera comes from, as in `seed 3`; none where no camera can be drawn in the room at all.
    pub(super) origin: Option<String>,
    pub(super) why: CameraRefusal,
}

/// The rule that a camera breaks.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum CameraRefusal {
    /// No camera could be drawn.
    #[error(transparent)]
    Sampler(#[from] CameraError),
    /// Too many pixels of the five views see the outside.
    #[error("{:.0} % of the pixels see the outside, expected at most {:.0} %", 100.0 * share, 100.0 * most)]
    SeesOutside {
        /// The share found.
        share: f64,
        /// The largest share that the rules allow.
        most: f64,
    },
    /// The input view sees too little furniture.
    #[error("it sees {seen} pieces of furniture, expected at least {least}")]
    SeesTooLittle {
        /// Number of pieces that it sees.
        seen: usize,
        /// The smallest number that the rules allow.
        least: usize,
    },
    /// A surface is too near in one of the five views.
    #[error("a surface is {nearest_m:.1e} m away, expected at least {least_m} m")]
    TooNear {
        /// Distance to the nearest surface, in metres.
        nearest_m: f64,
        /// The smallest distance that the rules allow, in metres.
        least_m: f64,
    },
}

impl std::fmt::Display for RefusedCamera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.origin {
            Some(origin) => write!(f, "{origin}: {}", self.why),
            None => write!(f, "{}", self.why),
        }
    }
}
