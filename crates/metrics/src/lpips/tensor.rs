//! The layers of a network: values at the pixels of a grid, convolutions with the rectifier after them, and max
//! pooling, each for the pixels that are asked for alone.
//!
//! A convolution is a matrix product: each output pixel's patch of the input becomes a row of a matrix ("im2col"),
//! which is multiplied with the weights. A thread holds only [`BLOCK_PIXELS`] rows at a time. Blocks, and so the order
//! of every sum, do not depend on the number of threads.

use rayon::prelude::*;

/// Values at the pixels of a grid: row by row, the channels of a pixel side by side.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tensor {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) channels: usize,
    pub(crate) values: Vec<f32>,
}

impl Tensor {
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

/// A set of the pixels of a grid, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PixelSet {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) holds: Vec<bool>,
}

/// How a layer's output pixel looks at its input: a square window, moved by the stride, with zeros around the input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    pub(crate) side: usize,
    pub(crate) stride: usize,
    pub(crate) padding: usize,
}

impl Window {
    /// The input pixels along an axis of `length` that output pixel `at` reads.
    fn along(&self, at: usize, length: usize) -> std::ops::Range<usize> {
        let start = at * self.stride;
        let inside = |at: usize| at.saturating_sub(self.padding).min(length);
        inside(start)..inside(start + self.side)
    }

    /// Width or height of the output; `None` if the window does not fit.
    pub(crate) fn output_side(&self, side: usize) -> Option<usize> {
        Some((side + 2 * self.padding).checked_sub(self.side)? / self.stride + 1)
    }
}

impl PixelSet {
    pub(crate) fn filled(width: usize, height: usize, holds: bool) -> Self {
        Self { width, height, holds: vec![holds; width * height] }
    }

    /// The pixels in the set, in order.
    pub(crate) fn pixels(&self) -> Vec<usize> {
        self.holds.iter().enumerate().filter(|(_, holds)| **holds).map(|(pixel, _)| pixel).collect()
    }

    /// The output pixels, of a grid of this size, whose window reads any of these.
    pub(crate) fn reaching(&self, window: Window, width: usize, height: usize) -> Self {
        let mut reached = Self::filled(width, height, false);
        for y in 0..height {
            let rows = window.along(y, self.height);
            // Whether each column holds any pixel of these rows.
            let mut columns = vec![false; self.width];
            for row in rows.map(|row| &self.holds[row * self.width..(row + 1) * self.width]) {
                columns.iter_mut().zip(row).for_each(|(any, holds)| *any |= holds);
            }
            for x in 0..width {
                reached.holds[y * width + x] = columns[window.along(x, self.width)].contains(&true);
            }
        }
        reached
    }

    /// The input pixels, of a grid of this size, that the windows of these read.
    pub(crate) fn read(&self, window: Window, width: usize, height: usize) -> Self {
        let mut read = Self::filled(width, height, false);
        for y in 0..self.height {
            let mut columns = vec![false; width];
            for x in (0..self.width).filter(|x| self.holds[y * self.width + x]) {
                columns[window.along(x, width)].fill(true);
            }
            for row in window.along(y, height) {
                read.holds[row * width..(row + 1) * width].iter_mut().zip(&columns).for_each(|(all, any)| *all |= any);
            }
        }
        read
    }

    /// Adds the pixels of another set of the same grid.
    pub(crate) fn add(&mut self, other: &Self) {
        self.holds.iter_mut().zip(&other.holds).for_each(|(ours, theirs)| *ours |= theirs);
    }

    /// The pixels that both hold.
    pub(crate) fn shared(mut self, other: &Self) -> Self {
        self.holds.iter_mut().zip(&other.holds).for_each(|(ours, theirs)| *ours &= theirs);
        self
    }
}

/// Output pixels of one matrix product: enough for an efficient product, few enough that small pictures occupy several
/// threads.
const BLOCK_PIXELS: usize = 192;

/// The shape of a convolution with a square kernel and zeros around the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shape {
    pub(crate) kernel: usize,
    pub(crate) stride: usize,
    pub(crate) padding: usize,
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
}

impl Shape {
    /// Values in one patch.
    pub(crate) fn patch(&self) -> usize {
        self.kernel * self.kernel * self.inputs
    }

    /// The window of the input that an output pixel reads.
    pub(crate) fn window(&self) -> Window {
        Window { side: self.kernel, stride: self.stride, padding: self.padding }
    }

    /// Width or height of the output; `None` if the kernel does not fit.
    pub(crate) fn output_side(&self, side: usize) -> Option<usize> {
        self.window().output_side(side)
    }
}

/// A convolution with its weights.
#[derive(Debug)]
pub(crate) struct Convolution {
    pub(crate) shape: Shape,
    /// [height, width, in, out].
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Convolution {
    /// Takes weights as [out, in, height, width]. Panics if the lengths do not fit the shape.
    pub(crate) fn new(shape: Shape, weights: &[f32], bias: Vec<f32>) -> Self {
        assert_eq!(weights.len(), shape.patch() * shape.outputs, "weights do not fit the convolution");
        assert_eq!(bias.len(), shape.outputs, "biases do not fit the convolution");
        let mut turned = vec![0.0; weights.len()];
        for (out, of_output) in weights.chunks(shape.patch()).enumerate() {
            for (input, of_input) in of_output.chunks(shape.kernel * shape.kernel).enumerate() {
                for (position, &weight) in of_input.iter().enumerate() {
                    turned[(position * shape.inputs + input) * shape.outputs + out] = weight;
                }
            }
        }
        Self { shape, weights: turned, bias }
    }

    /// Replaces those of the output's pixels, by index, by the convolution of the input, with 0 for negative values.
    /// Panics if the output has another size or number of channels.
    pub(crate) fn apply(&self, input: &Tensor, pixels: &[usize], output: &mut Tensor) {
        let side = |input| self.shape.output_side(input).expect("the picture's size was checked against the network");
        assert_eq!(
            (side(input.width), side(input.height)),
            (output.width, output.height),
            "another size of the output"
        );
        assert_eq!((input.channels, output.channels), (self.shape.inputs, self.shape.outputs), "other channels");
        let width = output.width;
        let mut found = vec![0.0; pixels.len() * self.shape.outputs];
        let blocks = found.par_chunks_mut(BLOCK_PIXELS * self.shape.outputs).zip(pixels.par_chunks(BLOCK_PIXELS));
        blocks.for_each_init(Vec::new, |patches, (values, pixels)| {
            self.fill_block(input, width, pixels, patches, values);
        });
        output.set(pixels, found);
    }

    /// Computes the output pixels of these indices; `width` is the output's. `patches` is memory for reuse.
    fn fill_block(&self, input: &Tensor, width: usize, pixels: &[usize], patches: &mut Vec<f32>, values: &mut [f32]) {
        let (patch, outputs) = (self.shape.patch(), self.shape.outputs);
        patches.resize(pixels.len() * patch, 0.0);
        for (&pixel, row) in pixels.iter().zip(patches.chunks_mut(patch)) {
            self.fill_patch(input, pixel % width, pixel / width, row);
        }
        values.chunks_mut(outputs).for_each(|pixel| pixel.copy_from_slice(&self.bias));
        add_product(values, patches, &self.weights, patch, outputs);
        values.iter_mut().for_each(|value| *value = value.max(0.0));
    }

    /// Copies the input under the kernel of output pixel (x, y): rows from the top, pixels from the left, channels.
    fn fill_patch(&self, input: &Tensor, x: usize, y: usize, patch: &mut [f32]) {
        let Shape { kernel, stride, padding, inputs, .. } = self.shape;
        // The kernel's columns `left..right` lie inside the input.
        let left = padding.saturating_sub(x * stride).min(kernel);
        let right = (input.width + padding).saturating_sub(x * stride).min(kernel).max(left);
        for (dy, row) in patch.chunks_mut(kernel * inputs).enumerate() {
            let inside = (y * stride + dy).checked_sub(padding).filter(|&y| y < input.height);
            let Some(y) = inside.filter(|_| right > left) else {
                row.fill(0.0);
                continue;
            };
            row[..left * inputs].fill(0.0);
            let seen = input.stretch(x * stride + left - padding, y, right - left);
            row[left * inputs..right * inputs].copy_from_slice(seen);
            row[right * inputs..].fill(0.0);
        }
    }
}

/// Adds the matrix product `left * right` to `sum`. All are stored row by row: `sum` is rows x `columns`, `left` is
/// rows x `inner`, `right` is `inner` x `columns`. Runs on the calling thread, so that the order of sums depends on the
/// sizes and the processor alone.
///
/// Panics if the lengths do not fit.
pub(crate) fn add_product(sum: &mut [f32], left: &[f32], right: &[f32], inner: usize, columns: usize) {
    assert!(inner > 0 && columns > 0, "a product of matrices without rows or columns");
    let rows = sum.len() / columns;
    assert_eq!(sum.len(), rows * columns, "the sum is not rows x columns");
    assert_eq!(left.len(), rows * inner, "the left factor is not rows x inner");
    assert_eq!(right.len(), inner * columns, "the right factor is not inner x columns");
    // `gemm` takes (pointer, column stride, row stride); a Vec's length always fits an isize.
    let (row_of_sum, row_of_left) = (columns as isize, inner as isize);
    // SAFETY: by the three asserts every index row * row stride + column lies inside its slice; `sum` is borrowed
    // mutably and so overlaps neither factor.
    #[allow(unsafe_code)] // `gemm` has no safe entry
    unsafe {
        gemm::gemm(
            rows,
            columns,
            inner,
            sum.as_mut_ptr(),
            1,
            row_of_sum,
            true,
            left.as_ptr(),
            1,
            row_of_left,
            right.as_ptr(),
            1,
            row_of_sum,
            1.0,
            1.0,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

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
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Both directions agree with the definition, pair by pair of an input and an output pixel.
        #[test]
        fn a_window_joins_what_it_reads(
            (side, stride, padding) in (1_usize..5, 1_usize..4, 0_usize..3),
            (width, height) in (5_usize..12, 5_usize..12),
            pick: usize,
        ) {
            let window = Window { side, stride, padding };
            let out = [width, height].map(|length| window.output_side(length).unwrap());
            let joined = |input: usize, output: usize| {
                let one = |input: usize, output: usize| {
                    (output * stride..output * stride + side).contains(&(input + padding))
                };
                one(input % width, output % out[0]) && one(input / width, output / out[0])
            };
            let only = |count: (usize, usize)| {
                let mut set = PixelSet::filled(count.0, count.1, false);
                let at = pick % set.holds.len();
                set.holds[at] = true;
                (at, set)
            };
            let (input, set) = only((width, height));
            let reached = set.reaching(window, out[0], out[1]);
            prop_assert!((0..out[0] * out[1]).all(|output| reached.holds[output] == joined(input, output)));
            let (output, set) = only((out[0], out[1]));
            let read = set.read(window, width, height);
            prop_assert!((0..width * height).all(|input| read.holds[input] == joined(input, output)));
        }
    }

    /// The convolution at every pixel.
    fn whole(convolution: &Convolution, input: &Tensor) -> Tensor {
        let side = |n| convolution.shape.output_side(n).expect("fits");
        let mut output = Tensor::zeros(side(input.width), side(input.height), convolution.shape.outputs);
        let all: Vec<usize> = (0..output.width * output.height).collect();
        convolution.apply(input, &all, &mut output);
        output
    }

    fn random_values(count: usize, seed: u64) -> Vec<f32> {
        let mut state = seed | 1;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
        };
        (0..count).map(|_| next()).collect()
    }

    /// The definition as plain sums. `shift` moves the input, for the twin that must fail.
    fn direct(shape: &Shape, weights: &[f32], bias: &[f32], input: &Tensor, shift: usize) -> Vec<f64> {
        let side = |n| shape.output_side(n).expect("fits");
        let mut output = Vec::new();
        for (y, x) in (0..side(input.height)).flat_map(|y| (0..side(input.width)).map(move |x| (y, x))) {
            for out in 0..shape.outputs {
                let mut sum = f64::from(bias[out]);
                for (c, dy, dx) in (0..shape.inputs)
                    .flat_map(|c| (0..shape.kernel).flat_map(move |dy| (0..shape.kernel).map(move |dx| (c, dy, dx))))
                {
                    let (iy, ix) = (y * shape.stride + dy, x * shape.stride + dx + shift);
                    if iy < shape.padding || ix < shape.padding {
                        continue;
                    }
                    let (iy, ix) = (iy - shape.padding, ix - shape.padding);
                    if iy < input.height && ix < input.width {
                        let weight = weights[((out * shape.inputs + c) * shape.kernel + dy) * shape.kernel + dx];
                        sum += f64::from(weight) * f64::from(input.stretch(ix, iy, 1)[c]);
                    }
                }
                output.push(sum.max(0.0));
            }
        }
        output
    }

    fn largest_difference(found: &Tensor, expected: &[f64]) -> f64 {
        assert_eq!(found.values.len(), expected.len());
        found.values.iter().zip(expected).map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn equals_the_definition(
            (kernel, stride, padding) in (1_usize..6, 1_usize..5, 0_usize..4),
            (inputs, outputs) in (1_usize..5, 1_usize..6),
            (width, height) in (6_usize..30, 6_usize..30),
            seed: u64,
        ) {
            let shape = Shape { kernel, stride, padding, inputs, outputs };
            let (weights, bias) = (random_values(shape.patch() * outputs, seed), random_values(outputs, !seed));
            let input = Tensor { width, height, channels: inputs, values: random_values(width * height * inputs, seed ^ 7) };
            let found = whole(&Convolution::new(shape, &weights, bias.clone()), &input);
            prop_assert!(largest_difference(&found, &direct(&shape, &weights, &bias, &input, 0)) < 1e-4);
        }
    }

    #[test]
    fn a_shifted_input_is_noticed() {
        let shape = Shape { kernel: 3, stride: 1, padding: 1, inputs: 2, outputs: 3 };
        let (weights, bias) = (random_values(54, 1), random_values(3, 2));
        let input = Tensor { width: 20, height: 17, channels: 2, values: random_values(680, 3) };
        let found = whole(&Convolution::new(shape, &weights, bias.clone()), &input);
        assert!(largest_difference(&found, &direct(&shape, &weights, &bias, &input, 0)) < 1e-5);
        assert!(largest_difference(&found, &direct(&shape, &weights, &bias, &input, 1)) > 0.1);
    }

    #[test]
    fn only_the_named_pixels_change() {
        let shape = Shape { kernel: 3, stride: 2, padding: 1, inputs: 4, outputs: 5 };
        let convolution = Convolution::new(shape, &random_values(shape.patch() * 5, 7), random_values(5, 8));
        let input = Tensor { width: 21, height: 17, channels: 4, values: random_values(21 * 17 * 4, 9) };
        let all = whole(&convolution, &input);
        let mut some = Tensor::zeros(all.width, all.height, 5);
        let pixels: Vec<usize> = (0..all.width * all.height).filter(|pixel| pixel % 7 < 2).collect();
        convolution.apply(&input, &pixels, &mut some);
        for (pixel, (found, expected)) in some.values.chunks(5).zip(all.values.chunks(5)).enumerate() {
            let expected = if pixels.contains(&pixel) { expected } else { &[0.0; 5] };
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{pixel}");
        }
    }

    #[test]
    fn the_thread_count_changes_no_bit() {
        let shape = Shape { kernel: 3, stride: 1, padding: 1, inputs: 32, outputs: 24 };
        let convolution = Convolution::new(shape, &random_values(shape.patch() * 24, 4), random_values(24, 5));
        let input = Tensor { width: 45, height: 31, channels: 32, values: random_values(45 * 31 * 32, 6) };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| whole(&convolution, &input))
        };
        let one = with(1);
        assert!(one.values.iter().any(|&v| v > 0.0) && one.values.contains(&0.0));
        assert_eq!(one, with(2));
        assert_eq!(one, with(3));
    }

    #[test]
    fn a_product_by_hand() {
        let mut sum = [1.0, 0.0, 0.0, 1.0];
        add_product(&mut sum, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &[1.0, 0.0, 0.0, 1.0, 2.0, 2.0], 3, 2);
        assert_eq!(sum, [8.0, 8.0, 16.0, 18.0]);
    }

    #[test]
    #[should_panic(expected = "left factor")]
    fn lengths_that_do_not_fit_are_refused() {
        add_product(&mut [0.0; 4], &[0.0; 5], &[0.0; 6], 3, 2);
    }

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
