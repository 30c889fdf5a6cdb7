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
//! Means are summed in `f64` in a fixed order; the thread count changes no bit. A value that is NaN or infinite and
//! would count is an error; one that would not is never looked at.

pub mod error;
pub mod lpips;
pub mod mask;
pub mod mse;
pub mod pixel;
pub mod psnr;
pub mod ssim;

pub use error::MetricError;
pub use lpips::{Features, Lpips, Net};
pub use mse::mse;
pub use pixel::Pixel;
pub use psnr::Psnr;
pub use ssim::{MaskedSsim, ssim, ssim_black_fill, ssim_map, ssim_valid_windows};
