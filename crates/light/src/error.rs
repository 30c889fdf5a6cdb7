//! The one error of this crate.

/// Why lights could not be fitted to a photo.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LightError {
    /// Mask and photo differ in size.
    #[error("cannot fit lights: the mask has {}x{} pixels, the photo {}x{}", mask[0], mask[1], photo[0], photo[1])]
    MaskSize {
        /// Width and height of the mask.
        mask: [usize; 2],
        /// Width and height of the photo.
        photo: [usize; 2],
    },
    /// A light's picture and the photo differ in size.
    #[error("cannot fit lights: the basis has {}x{} pixels, the photo {}x{}", basis[0], basis[1], photo[0], photo[1])]
    BasisSize {
        /// Width and height of the basis.
        basis: [usize; 2],
        /// Width and height of the photo.
        photo: [usize; 2],
    },
    /// The photo holds infinities or NaN.
    #[error("cannot fit lights: the photo holds numbers that are not finite")]
    PhotoNotFinite,
    /// A light's picture holds what no light sends.
    #[error("cannot fit lights: the picture of light group {group} holds negative or not finite numbers")]
    BasisPicture {
        /// The group's place in the basis.
        group: usize,
    },
    /// The solver found no finite weights.
    #[error("cannot fit lights: the solver found no finite weights; please report this basis")]
    NoSolution,
}
