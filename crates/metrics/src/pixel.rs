//! The trait of pixels that can be compared, the checks that every metric begins with, and two ways to fill the pixels
//! outside a mask, for metrics whose windows reach across its edge.

use std::path::PathBuf;

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};

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
        prediction: Size,
        /// `reference`, `mask` or another of the inputs.
        what: &'static str,
        found: Size,
    },

    /// The picture is smaller than the metric's window or network needs.
    #[error("{metric} needs a picture of at least {least}x{least} pixels; found {}x{}", found.0, found.1)]
    TooSmall {
        /// The metric's key, as in results.
        metric: &'static str,
        /// Least width and height.
        least: usize,
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
    InvalidMse { mse: f64 },

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
    WeightsIo { path: PathBuf, source: std::io::Error },

    /// The weights file has another hash than the published one.
    #[error("the LPIPS weights '{}' have SHA-256 {found}; expected {expected}", path.display())]
    WeightsHash {
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

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for super::LinearRgb {}
    impl Sealed for super::SrgbRgb {}
}

/// A pixel whose values are compared one by one: linear or sRGB-encoded RGB, or a scalar (roughness, metallic). Sealed:
/// no other crate can implement it.
pub trait Pixel: Copy + Default + Sync + sealed::Sealed {
    /// The values, channel by channel.
    fn channels(&self) -> &[f32];
}

impl Pixel for f32 {
    fn channels(&self) -> &[f32] {
        std::slice::from_ref(self)
    }
}

impl Pixel for LinearRgb {
    fn channels(&self) -> &[f32] {
        &self.0
    }
}

impl Pixel for SrgbRgb {
    fn channels(&self) -> &[f32] {
        &self.0
    }
}

/// Width and height.
pub(crate) fn size_of<T: Copy>(picture: &Picture<T>) -> Size {
    (picture.width(), picture.height())
}

/// Fails unless all three have one size.
pub(crate) fn check_sizes<P: Pixel>(
    prediction: &Picture<P>,
    reference: &Picture<P>,
    mask: Option<&Mask>,
) -> Result<(), MetricError> {
    check_size(size_of(prediction), "reference", size_of(reference))?;
    mask.map_or(Ok(()), |mask| check_size(size_of(prediction), "mask", size_of(mask)))
}

/// Fails unless `what` has the prediction's size.
pub(crate) fn check_size(prediction: Size, what: &'static str, found: Size) -> Result<(), MetricError> {
    if prediction == found { Ok(()) } else { Err(MetricError::SizesDiffer { prediction, what, found }) }
}

/// Fails unless every value inside the mask is finite; the error calls the picture `name`.
pub(crate) fn check_finite<P: Pixel>(
    name: &'static str,
    picture: &Picture<P>,
    mask: Option<&Mask>,
) -> Result<(), MetricError> {
    for (index, pixel) in picture.pixels().iter().enumerate() {
        if mask.is_some_and(|mask| !mask.pixels()[index]) {
            continue;
        }
        if let Some(channel) = pixel.channels().iter().position(|value| !value.is_finite()) {
            let (x, y) = (index % picture.width(), index / picture.width());
            return Err(MetricError::NotFinite { picture: name, x, y, channel, value: pixel.channels()[channel] });
        }
    }
    Ok(())
}

/// Checks sizes, then values of both pictures.
pub(crate) fn check_pair<P: Pixel>(
    prediction: &Picture<P>,
    reference: &Picture<P>,
    mask: Option<&Mask>,
) -> Result<(), MetricError> {
    check_sizes(prediction, reference, mask)?;
    check_finite("prediction", prediction, mask)?;
    check_finite("reference", reference, mask)
}

/// The number of pixels that count.
pub fn pixel_count(mask: &Mask) -> usize {
    mask.pixels().iter().filter(|&&counts| counts).count()
}

/// The picture with black (zero) outside the mask, where any value is allowed, NaN included. Fails if the sizes differ.
pub fn black_filled<P: Pixel>(picture: &Picture<P>, mask: &Mask) -> Result<Picture<P>, MetricError> {
    let black = Picture::filled(picture.width(), picture.height(), P::default());
    reference_filled(picture, &black, mask)
}

/// The prediction with the reference's pixels outside the mask. Fails if the sizes differ.
pub fn reference_filled<P: Pixel>(
    prediction: &Picture<P>,
    reference: &Picture<P>,
    mask: &Mask,
) -> Result<Picture<P>, MetricError> {
    check_sizes(prediction, reference, Some(mask))?;
    let mut filled = prediction.clone();
    let replacements = reference.pixels().iter().zip(mask.pixels());
    for (pixel, (&replacement, &counts)) in filled.pixels_mut().iter_mut().zip(replacements) {
        if !counts {
            *pixel = replacement;
        }
    }
    Ok(filled)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pixels_outside_the_mask_change() {
        let mask = Picture::new(3, 1, vec![true, false, true]).unwrap();
        let prediction = Picture::new(3, 1, vec![1.0_f32, f32::NAN, 3.0]).unwrap();
        let reference = Picture::new(3, 1, vec![7.0_f32, 8.0, 9.0]).unwrap();
        assert_eq!(reference_filled(&prediction, &reference, &mask).unwrap().pixels(), &[1.0, 8.0, 3.0]);
        assert_eq!(black_filled(&prediction, &mask).unwrap().pixels(), &[1.0, 0.0, 3.0]);
        assert_eq!(pixel_count(&mask), 2);
    }

    #[test]
    fn a_mask_of_another_size_is_an_error() {
        let picture = Picture::filled(3, 1, 0.5_f32);
        assert!(matches!(
            black_filled(&picture, &Picture::filled(1, 3, true)),
            Err(MetricError::SizesDiffer { what: "mask", .. })
        ));
    }
}
