//! The one error of this crate.

/// Why lights could not be fitted to a photo.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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
    /// The photo holds an infinity or NaN.
    #[error("cannot fit lights: pixel ({}, {}) of the photo is {value:?}, expected finite numbers", at[0], at[1])]
    PhotoNotFinite {
        /// Column and row of the first such pixel.
        at: [usize; 2],
        /// Its value.
        value: [f32; 3],
    },
    /// A light's picture holds an infinity or NaN.
    #[error(
        "cannot fit lights: pixel ({}, {}) of light group {group} is {value:?}, expected finite numbers",
        at[0], at[1]
    )]
    BasisPicture {
        /// The group's place in the basis.
        group: usize,
        /// Column and row of the first such pixel.
        at: [usize; 2],
        /// Its value.
        value: [f32; 3],
    },
    /// Two streams of samples show different lights.
    #[error("cannot fit lights: the two bases have {} and {} light groups", groups[0], groups[1])]
    StreamLights {
        /// Number of light groups of each basis.
        groups: [usize; 2],
    },
    /// A number that must be above 0 is not.
    #[error("cannot fit lights: the {what} is {value}, expected a finite number above 0")]
    NotPositive {
        /// Its name.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// The solver found no finite weights.
    #[error(
        "cannot fit lights: no finite weights of {lights} lights found for {squares} averaged squares; please report this \
         scene"
    )]
    NoSolution {
        /// Number of lights.
        lights: usize,
        /// Number of averaged squares of pixels.
        squares: usize,
    },
}
