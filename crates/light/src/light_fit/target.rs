//! What lights are fitted to.

use mateval_image::{LinearRgb, Mask, Picture};

/// The picture that lights are fitted to.
#[derive(Clone, Copy, Debug)]
pub struct FitTarget<'a> {
    /// Linear, before exposure.
    pub photo: &'a Picture<LinearRgb>,
    /// The pixels that count; all if there is none.
    pub mask: Option<&'a Mask>,
    /// The factor by which the photo is multiplied before it is clipped to 1, above 0.
    pub exposure: f64,
}
