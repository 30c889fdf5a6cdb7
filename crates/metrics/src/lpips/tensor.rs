//! The values between two layers of the network.

/// Values at the pixels of a grid: row by row, the channels of a pixel side by side.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tensor {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) channels: usize,
    pub(crate) values: Vec<f32>,
}

impl Tensor {
    /// Zero everywhere.
    pub(crate) fn zeros(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, values: vec![0.0; width * height * channels] }
    }

    /// The channels of `count` pixels in row `y` from column `x`.
    pub(crate) fn stretch(&self, x: usize, y: usize, count: usize) -> &[f32] {
        let start = (y * self.width + x) * self.channels;
        &self.values[start..start + count * self.channels]
    }

    /// Replaces the channels of these pixels, by index, by `values`, pixel after pixel.
    pub(crate) fn set(&mut self, pixels: &[usize], values: Vec<f32>) {
        // Every pixel once, in order: no copy is needed.
        if values.len() == self.values.len() && pixels.is_sorted() {
            self.values = values;
            return;
        }
        for (&pixel, values) in pixels.iter().zip(values.chunks(self.channels)) {
            self.values[pixel * self.channels..(pixel + 1) * self.channels].copy_from_slice(values);
        }
    }
}
