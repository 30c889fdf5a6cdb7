//! How far a picture is from the true one.
//!
//! In: a prediction and a reference of the same size, and the mask of the pixels that count, in that order. Out: one
//! number, or `None` where no pixel (or no window) counts. The pictures' types say their colour space; clipping to 0..1
//! and sRGB-encoding are the caller's, this crate changes no colours.
//!
//! [`mse()`] and [`Psnr`] look at pixels, [`mod@ssim`] at 11x11 windows (Wang et al. 2004), [`lpips`] at what two
//! trained networks see (Zhang et al. 2018). What happens outside the mask is a rule of its own for the last two, since
//! their windows look across its edge; [`mask`] has the two fillings they are built on.
//!
//! Renders are noisy, and noise is taken for error. Where a prediction comes in two independent halves, there are
//! metrics of what it would be without noise: [`mod@noise_free`] (and [`mod@encoding_bias`], what clipping and
//! sRGB-encoding the halves does to it), [`mod@ssim_halves`], and the extrapolated distances of [`Lpips`].
//!
//! Means are summed in `f64` in a fixed order; the thread count changes no bit. A value that is NaN or infinite and
//! would count is an error; one that would not is never looked at.

pub mod encoding_bias;
pub mod error;
pub mod lpips;
pub mod mask;
pub mod mse;
pub mod noise_free;
pub mod pixel;
pub mod psnr;
pub mod ssim;
pub mod ssim_halves;
#[cfg(test)]
mod synthetic_noise;

pub use encoding_bias::{EncodingBias, encoding_bias};
pub use error::MetricError;
pub use lpips::{ExtrapolatedLpips, Features, Lpips, MeanAndHalves, Net};
pub use mse::mse;
pub use noise_free::{BlockNoise, Halves, NoiseFreeMse, NoiseFreePsnr, NoisePsnr, noise_free_mse, psnr_mean_error};
pub use pixel::Pixel;
pub use psnr::Psnr;
pub use ssim::{MaskedSsim, ssim, ssim_black_fill, ssim_map, ssim_valid_windows};
pub use ssim_halves::{ssim_halves, ssim_halves_black_fill, ssim_halves_valid_windows};
