//! A picture: rows of pixels from the top left, with a type for each meaning of a pixel.

use crate::ImageError;

/// The luminance of linear Rec. 709 red, green and blue of 1 (ITU-R BT.709, section 3.2).
pub const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Linear Rec. 709 red, green, blue; unbounded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinearRgb(pub [f32; 3]);

impl LinearRgb {
    /// The relative luminance (ITU-R BT.709).
    #[inline]
    pub fn luminance(self) -> f64 {
        let [r, g, b] = self.0.map(f64::from);
        let [of_r, of_g, of_b] = LUMINANCE;
        of_r * r + of_g * g + of_b * b
    }
}

/// sRGB-encoded red, green, blue; 0 to 1 for displayable colours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SrgbRgb(pub [f32; 3]);

/// A unit vector in world space, or zero where there is no surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Normal(pub [f32; 3]);

/// Pixels that count (`true`) and pixels that do not.
pub type Mask = Picture<bool>;

/// `width` times `height` pixels, row by row, the top left first.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture<T> {
    width: usize,
    height: usize,
    pixels: Vec<T>,
}

impl<T: Copy> Picture<T> {
    /// A picture of these pixels, row by row from the top left. Fails if their number is not `width * height`.
    pub fn new(width: usize, height: usize, pixels: Vec<T>) -> Result<Self, ImageError> {
        let expected = width.saturating_mul(height);
        if pixels.len() != expected {
            return Err(ImageError::PixelCount { width, height, expected, found: pixels.len() });
        }
        Ok(Self { width, height, pixels })
    }

    /// A picture whose pixels all have one value.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, pixels: vec![value; width * height] }
    }

    /// A picture whose pixel (x, y) is `value_at(x, y)`, which is called row by row.
    pub fn from_fn(width: usize, height: usize, mut value_at: impl FnMut(usize, usize) -> T) -> Self {
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                pixels.push(value_at(x, y));
            }
        }
        Self { width, height, pixels }
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row by row from the top left.
    pub fn pixels(&self) -> &[T] {
        &self.pixels
    }

    /// All pixels, to be changed in place.
    pub fn pixels_mut(&mut self) -> &mut [T] {
        &mut self.pixels
    }

    pub fn into_pixels(self) -> Vec<T> {
        self.pixels
    }

    /// The pixel at column `x`, row `y`; panics outside the picture.
    pub fn get(&self, x: usize, y: usize) -> T {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) is outside {}x{}", self.width, self.height);
        self.pixels[y * self.width + x]
    }

    /// Sets the pixel at column `x`, row `y`; panics outside the picture.
    pub fn set(&mut self, x: usize, y: usize, value: T) {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) is outside {}x{}", self.width, self.height);
        self.pixels[y * self.width + x] = value;
    }

    /// A picture of the same size, with every pixel changed.
    pub fn map<U: Copy>(&self, change: impl FnMut(T) -> U) -> Picture<U> {
        Picture { width: self.width, height: self.height, pixels: self.pixels.iter().copied().map(change).collect() }
    }

    /// Whether both pictures have the same width and height.
    pub fn same_size<U: Copy>(&self, other: &Picture<U>) -> bool {
        self.width == other.width() && self.height == other.height()
    }
}

impl Picture<LinearRgb> {
    /// The picture clipped to 0..1 and sRGB-encoded. NaN becomes 0.
    pub fn to_srgb(&self) -> Picture<SrgbRgb> {
        self.map(|LinearRgb(rgb)| SrgbRgb(rgb.map(|v| crate::transfer::srgb_from_linear(v.clamp(0.0, 1.0)))))
    }
}

impl Picture<SrgbRgb> {
    pub fn to_linear(&self) -> Picture<LinearRgb> {
        self.map(|SrgbRgb(rgb)| LinearRgb(rgb.map(crate::transfer::linear_from_srgb)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn new_refuses_a_wrong_pixel_count() {
        assert!(matches!(
            Picture::new(2, 2, vec![0.0_f32; 3]),
            Err(ImageError::PixelCount { expected: 4, found: 3, .. })
        ));
    }

    #[test]
    fn rows_start_at_the_top_left() {
        let picture = Picture::from_fn(3, 2, |x, y| 10 * y + x);
        assert_eq!(picture.pixels(), &[0, 1, 2, 10, 11, 12]);
        assert_eq!(picture.get(1, 1), 11);
    }

    #[test]
    fn srgb_round_trip() {
        let picture = Picture::from_fn(16, 16, |x, y| LinearRgb([x as f32 / 15.0, y as f32 / 15.0, 0.5]));
        for (a, b) in picture.pixels().iter().zip(picture.to_srgb().to_linear().pixels()) {
            for channel in 0..3 {
                assert!((a.0[channel] - b.0[channel]).abs() < 2e-6);
            }
        }
    }
}
