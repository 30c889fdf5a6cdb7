//! Two ways to fill the pixels outside a mask, for metrics whose windows reach across its edge.

use mateval_image::{Mask, Picture};

use crate::MetricError;
use crate::pixel::{Pixel, check_sizes};

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
