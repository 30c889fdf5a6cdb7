//! A convolution and the rectifier after it, as matrix products.
//!
//! Each output pixel's patch of the input becomes a row of a matrix ("im2col"), which is multiplied with the weights.
//! A thread holds only [`BLOCK_PIXELS`] rows at a time. Blocks, and so the order of every sum, do not depend on the
//! number of threads.

use rayon::prelude::*;

use super::multiply::add_product;
use super::reach::Window;
use super::tensor::Tensor;

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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The convolution at every pixel.
    fn whole(convolution: &Convolution, input: &Tensor) -> Tensor {
        let side = |n| convolution.shape.output_side(n).expect("fits");
        let mut output = Tensor::zeros(side(input.width), side(input.height), convolution.shape.outputs);
        let all: Vec<usize> = (0..output.width * output.height).collect();
        convolution.apply(input, &all, &mut output);
        output
    }

    fn random(count: usize, seed: u64) -> Vec<f32> {
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
            let (weights, bias) = (random(shape.patch() * outputs, seed), random(outputs, !seed));
            let input = Tensor { width, height, channels: inputs, values: random(width * height * inputs, seed ^ 7) };
            let found = whole(&Convolution::new(shape, &weights, bias.clone()), &input);
            prop_assert!(largest_difference(&found, &direct(&shape, &weights, &bias, &input, 0)) < 1e-4);
        }
    }

    #[test]
    fn a_shifted_input_is_noticed() {
        let shape = Shape { kernel: 3, stride: 1, padding: 1, inputs: 2, outputs: 3 };
        let (weights, bias) = (random(54, 1), random(3, 2));
        let input = Tensor { width: 20, height: 17, channels: 2, values: random(680, 3) };
        let found = whole(&Convolution::new(shape, &weights, bias.clone()), &input);
        assert!(largest_difference(&found, &direct(&shape, &weights, &bias, &input, 0)) < 1e-5);
        assert!(largest_difference(&found, &direct(&shape, &weights, &bias, &input, 1)) > 0.1);
    }

    #[test]
    fn only_the_named_pixels_change() {
        let shape = Shape { kernel: 3, stride: 2, padding: 1, inputs: 4, outputs: 5 };
        let convolution = Convolution::new(shape, &random(shape.patch() * 5, 7), random(5, 8));
        let input = Tensor { width: 21, height: 17, channels: 4, values: random(21 * 17 * 4, 9) };
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
        let convolution = Convolution::new(shape, &random(shape.patch() * 24, 4), random(24, 5));
        let input = Tensor { width: 45, height: 31, channels: 32, values: random(45 * 31 * 32, 6) };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| whole(&convolution, &input))
        };
        let one = with(1);
        assert!(one.values.iter().any(|&v| v > 0.0) && one.values.contains(&0.0));
        assert_eq!(one, with(2));
        assert_eq!(one, with(3));
    }
}
