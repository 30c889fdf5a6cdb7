//! The error of this crate.

use std::path::PathBuf;

/// Width and height, pixels.
pub type Size = (usize, usize);

/// Why a metric has no value. `WeightsIo` is an io error, `TooSmall` is unsupported, all others are invalid input.
#[derive(Debug, thiserror::Error)]
pub enum MetricError {
    /// Prediction, reference and mask differ in size.
    #[error(
        "the {what} has {}x{} pixels; expected {}x{} like the prediction",
        found.0, found.1, prediction.0, prediction.1
    )]
    SizesDiffer {
        /// The prediction's size.
        prediction: Size,
        /// `reference`, `mask` or another of the inputs.
        what: &'static str,
        /// Its size.
        found: Size,
    },

    /// The picture is smaller than the metric's window or network needs.
    #[error("{metric} needs a picture of at least {least}x{least} pixels; found {}x{}", found.0, found.1)]
    TooSmall {
        /// The metric's key, as in results.
        metric: &'static str,
        /// Least width and height.
        least: usize,
        /// The picture's size.
        found: Size,
    },

    /// A value inside the mask is NaN or infinite.
    #[error("the {picture} has the value {value} at pixel ({x}, {y}), channel {channel}; expected finite values")]
    NotFinite {
        /// `prediction`, `reference`, `picture` or a half of one.
        picture: &'static str,
        /// Column, from the left.
        x: usize,
        /// Row, from the top.
        y: usize,
        /// Channel, from 0.
        channel: usize,
        /// NaN or an infinity.
        value: f32,
    },

    /// A number that is no mean squared error: negative or not finite.
    #[error("a mean squared error of {mse} has no PSNR; expected a finite value of at least 0")]
    InvalidMse {
        /// The value.
        mse: f64,
    },

    /// Two sets of features come from different networks, or from pictures of different sizes.
    #[error("cannot compare the features of {prediction} with those of {reference}; use one network and one size")]
    FeaturesDiffer {
        /// Network and size of the prediction's features.
        prediction: String,
        /// Network and size of the reference's features.
        reference: String,
    },

    /// The weights file does not exist or cannot be read.
    #[error("cannot read the LPIPS weights '{}': {source}", path.display())]
    WeightsIo {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },

    /// The weights file has another hash than the published one.
    #[error("the LPIPS weights '{}' have SHA-256 {found}; expected {expected}", path.display())]
    WeightsHash {
        /// The file.
        path: PathBuf,
        /// The hash of the right file.
        expected: &'static str,
        /// The hash of this file, or of its first 64 MiB where it is larger.
        found: String,
    },

    /// The weights do not fit the network.
    #[error("the LPIPS weights are malformed: {reason}")]
    WeightsMalformed {
        /// What was expected and what was found.
        reason: String,
    },
}
