//! Max pooling: the largest value of each channel in a moving window.

use rayon::prelude::*;

use super::tensor::Tensor;

/// A square window and its stride. Windows stay inside the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pool {
    pub(crate) window: usize,
    pub(crate) stride: usize,
}

impl Pool {
    /// Width or height of the output; `None` if the window does not fit.
    pub(crate) fn output_side(&self, side: usize) -> Option<usize> {
        Some(side.checked_sub(self.window)? / self.stride + 1)
    }

    /// The pooled input. Panics if the window does not fit.
    pub(crate) fn apply(&self, input: &Tensor) -> Tensor {
        let side = |input| self.output_side(input).expect("the picture's size was checked against the network");
        let mut output = Tensor::zeros(side(input.width), side(input.height), input.channels);
        let row = output.width * output.channels;
        output.values.par_chunks_mut(row).enumerate().for_each(|(y, row)| self.fill_row(input, y, row));
        output
    }

    fn fill_row(&self, input: &Tensor, y: usize, row: &mut [f32]) {
        for (x, pixel) in row.chunks_mut(input.channels).enumerate() {
            pixel.fill(f32::NEG_INFINITY);
            for dy in 0..self.window {
                let stretch = input.stretch(x * self.stride, y * self.stride + dy, self.window);
                for candidates in stretch.chunks(input.channels) {
                    pixel.iter_mut().zip(candidates).for_each(|(max, &value)| *max = max.max(value));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlapping_windows_channel_by_channel() {
        // Two channels: x + 10 y, and its negative.
        let values = (0..4).flat_map(|y| (0..6).map(move |x| (x + 10 * y) as f32)).flat_map(|v| [v, -v]).collect();
        let input = Tensor { width: 6, height: 4, channels: 2, values };
        let output = Pool { window: 3, stride: 2 }.apply(&input);
        assert_eq!((output.width, output.height), (2, 1));
        assert_eq!(output.values, [22.0, 0.0, 24.0, -2.0]);
        assert_eq!(Pool { window: 3, stride: 2 }.output_side(2), None);
    }
}
