//! The trait of pixels that can be compared, and the checks that every metric begins with.

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};

use crate::MetricError;
use crate::error::Size;

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
