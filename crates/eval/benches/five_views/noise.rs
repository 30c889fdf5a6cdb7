//! The noise of pictures.

use mateval_image::{LinearRgb, Picture};

/// The mean squared error of a tool's picture relative to the picture that it converges to.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    pub linear: f64,
    /// Clipped to 0..1 and sRGB-encoded, as for scores.
    pub srgb: f64,
}

impl Noise {
    /// Estimates it from two independent pictures: half the mean square of their difference.
    pub fn of(a: &[f32], b: &[f32]) -> Self {
        let half_square = |a: &[f32], b: &[f32]| mean(a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2) / 2.0));
        Self { linear: half_square(a, b), srgb: half_square(&srgb(a), &srgb(b)) }
    }
}

/// The mean squared difference between the pictures that two tools converge to, linear and in sRGB, estimated without
/// noise from two independent pictures of each; and the ratio of their means.
pub fn disagreement(a: [Vec<f32>; 2], b: [Vec<f32>; 2]) -> String {
    let product = |a: [&[f32]; 2], b: [&[f32]; 2]| {
        mean((0..a[0].len()).map(|i| f64::from(a[0][i] - b[0][i]) * f64::from(a[1][i] - b[1][i])))
    };
    let encoded = [&a[0], &a[1], &b[0], &b[1]].map(|values| srgb(values));
    let whole = |p: &[Vec<f32>; 2]| mean(p.iter().flatten().map(|&v| f64::from(v)));
    format!(
        "{:.2e} | {:.2e} | means {:.4}",
        product([&a[0], &a[1]], [&b[0], &b[1]]),
        product([&encoded[0], &encoded[1]], [&encoded[2], &encoded[3]]),
        whole(&b) / whole(&a)
    )
}

fn srgb(values: &[f32]) -> Vec<f32> {
    let pixels = values.chunks_exact(3).map(|rgb| LinearRgb([rgb[0], rgb[1], rgb[2]])).collect();
    let picture = Picture::new(values.len() / 3, 1, pixels).unwrap();
    picture.to_srgb().pixels().iter().flat_map(|pixel| pixel.0).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, count), value| (sum + value, count + 1));
    sum / count as f64
}
