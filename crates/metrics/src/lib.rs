//! Metrics of the difference between a picture and a reference.
//!
//! In: a prediction and a reference of the same size, and the mask of the pixels that count, in that order. Out: one
//! number, or `None` where no pixel (or no window) counts. The type of a picture is its colour space; the caller clips
//! to 0..1 and encodes to sRGB, this crate changes no colours.
//!
//! [`mse()`] and [`Psnr`] compare pixels, [`mod@ssim`] compares 11x11 windows (Wang et al. 2004), [`lpips`] compares
//! the responses of two trained networks (Zhang et al. 2018). The last two have two rules for pixels outside the mask,
//! since their windows reach across its edge; [`mask`] holds the two ways to fill those pixels.
//!
//! Renders are noisy, and a metric counts noise as error. For a prediction in four independent quarters ([`noisy_render`]),
//! [`mod@noise_free`] estimates the mean squared error without noise.
//!
//! Means are summed in `f64` in a fixed order, so the number of threads changes no bit. A NaN or infinite value inside
//! the mask is an error; values outside the mask are not read.

pub mod error;
pub mod halves;
pub mod lpips;
pub mod mask;
pub mod mse;
pub mod noise_free;
pub mod noisy_render;
pub mod pixel;
pub mod psnr;
pub mod ssim;

pub use error::MetricError;
pub use halves::Halves;
pub use lpips::{Features, Lpips, Net};
pub use mse::mse;
pub use noise_free::{BlockNoise, NoiseFreeMse, NoiseFreePsnr, NoisePsnr, Variances, noise_free_mse, psnr_mean_error};
pub use noisy_render::{NoisyHalf, NoisyRender, encoded_reference};
pub use pixel::Pixel;
pub use psnr::Psnr;
pub use ssim::{MaskedSsim, ssim, ssim_black_fill, ssim_map, ssim_valid_windows};
