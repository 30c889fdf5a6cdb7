//! The ranges of a recipe's numbers.

/// Farthest that a camera may stand from the origin along an axis, in metres. Beyond that, neighbouring `f32` numbers are
/// centimetres apart.
pub(super) const FARTHEST_M: f64 = 1e6;
/// Least and most pixels of a picture's side.
pub(crate) const RESOLUTION: std::ops::RangeInclusive<u32> = 16..=8192;
/// Least and most texels of an atlas's side.
pub const ATLAS_SIZES: std::ops::RangeInclusive<u32> = 64..=4096;
