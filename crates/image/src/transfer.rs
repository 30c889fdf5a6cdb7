//! The sRGB transfer function (IEC 61966-2-1), computed with the `libm` crate for the same bits on every machine.

use std::sync::LazyLock;

/// The sRGB-encoded value of a linear one. Outside 0..1 the same formula continues, linear below 0.
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::powf(linear, 1.0 / 2.4) - 0.055 }
}

/// [`srgb_from_linear`] in double precision, with the slope of the curve there.
pub fn srgb_with_slope(linear: f64) -> (f64, f64) {
    if linear <= 0.003_130_8 {
        return (12.92 * linear, 12.92);
    }
    let scaled = 1.055 * libm::pow(linear, 1.0 / 2.4);
    (scaled - 0.055, scaled / (2.4 * linear))
}

/// The linear value of an sRGB-encoded one, the inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { libm::powf((encoded + 0.055) / 1.055, 2.4) }
}

static LINEAR_FROM_BYTE: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| linear_from_srgb(byte as f32 / 255.0)));

/// The linear value of every sRGB byte, indexed by the byte.
pub(crate) fn linear_from_srgb_bytes() -> &'static [f32; 256] {
    &LINEAR_FROM_BYTE
}

/// Linear value of an sRGB byte, from a table.
pub fn linear_from_srgb_byte(byte: u8) -> f32 {
    LINEAR_FROM_BYTE[usize::from(byte)]
}

static LINEAR_FROM_WORD: LazyLock<Vec<f32>> =
    LazyLock::new(|| (0..=u16::MAX).map(|word| linear_from_srgb(f32::from(word) / 65535.0)).collect());

/// The linear value of every sRGB-encoded 16-bit word, indexed by the word.
pub(crate) fn linear_from_srgb_words() -> &'static [f32] {
    &LINEAR_FROM_WORD
}

/// The 16-bit word nearest to a value of 0 to 1; clipped, NaN becomes 0.
pub fn word_from_unit(value: f32) -> u16 {
    (value.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16
}

/// The byte nearest to a value of 0 to 1; clipped, NaN becomes 0.
pub fn byte_from_unit(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Commonly published values: 188 for linear 0.5, and 0.2140 for encoded 0.5.
    #[test]
    fn known_values() {
        assert_eq!(byte_from_unit(srgb_from_linear(0.5)), 188);
        assert!((linear_from_srgb(0.5) - 0.214_041_14).abs() < 1e-6);
        assert_eq!(linear_from_srgb_byte(255), 1.0);
        assert_eq!(byte_from_unit(f32::NAN), 0);
    }

    #[test]
    fn the_slope_is_that_of_the_curve() {
        for linear in [-0.5, 0.002, 0.004, 0.2, 0.9] {
            let (encoded, slope) = srgb_with_slope(linear);
            let difference = srgb_with_slope(linear + 1e-6).0 - srgb_with_slope(linear - 1e-6).0;
            assert!((encoded - f64::from(srgb_from_linear(linear as f32))).abs() < 1e-6, "{linear}");
            assert!((slope - difference / 2e-6).abs() < 1e-6 * slope, "{linear}");
        }
    }

    #[test]
    fn words_are_finer_than_bytes() {
        let value = 0.893_289;
        let word = linear_from_srgb_words()[usize::from(word_from_unit(srgb_from_linear(value)))];
        let byte = linear_from_srgb_byte(byte_from_unit(srgb_from_linear(value)));
        assert!((word - value).abs() < 2e-5 && (byte - value).abs() > 1e-3);
    }

    #[test]
    fn every_byte_survives() {
        for byte in 0..=255_u8 {
            assert_eq!(byte_from_unit(srgb_from_linear(linear_from_srgb_byte(byte))), byte);
        }
    }
}
