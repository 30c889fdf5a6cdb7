//! How integers encode colours.

/// How the integers of a file encode colours. Floats (EXR, HDR, NumPy) are always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// With the sRGB curve.
    Srgb,
    /// Linearly.
    Linear,
}
