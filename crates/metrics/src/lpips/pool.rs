//! Max pooling: the largest value of each channel in a moving window.

use rayon::prelude::*;

use super::reach::Window;
use super::tensor::Tensor;

/// A square window and its stride. Windows stay inside the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pool {
    pub(crate) window: usize,
    pub(crate) stride: usize,
}

impl Pool {
    /// The window of the input that an output pixel reads.
    pub(crate) fn window(&self) -> Window {
        Window { side: self.window, stride: self.stride, padding: 0 }
    }

    /// Width or height of the output; `None` if the window does not fit.
    pub(crate) fn output_side(&self, side: usize) -> Option<usize> {
        self.window().output_side(side)
    }

    /// Replaces those of the output's pixels, by index, by the pooled input. Panics if the output has another size.
    pub(crate) fn apply(&self, input: &Tensor, pixels: &[usize], output: &mut Tensor) {
        let side = |input| self.output_side(input).expect("the picture's size was checked against the network");
        assert_eq!(
            (side(input.width), side(input.height)),
            (output.width, output.height),
            "another size of the output"
        );
        let width = output.width;
        let mut found = vec![f32::NEG_INFINITY; pixels.len() * input.channels];
        let pairs = found.par_chunks_mut(input.channels).with_min_len(64).zip(pixels);
        pairs.for_each(|(values, &pixel)| self.fill_pixel(input, pixel % width, pixel / width, values));
        output.set(pixels, found);
    }

    fn fill_pixel(&self, input: &Tensor, x: usize, y: usize, pixel: &mut [f32]) {
        for dy in 0..self.window {
            let stretch = input.stretch(x * self.stride, y * self.stride + dy, self.window);
            for candidates in stretch.chunks(input.channels) {
                pixel.iter_mut().zip(candidates).for_each(|(max, &value)| *max = max.max(value));
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
        let mut output = Tensor::zeros(2, 1, 2);
        Pool { window: 3, stride: 2 }.apply(&input, &[0, 1], &mut output);
        assert_eq!(output.values, [22.0, 0.0, 24.0, -2.0]);
        assert_eq!(Pool { window: 3, stride: 2 }.output_side(2), None);
    }
}
