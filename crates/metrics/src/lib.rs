//! Metrics of the difference between a picture and a reference.
//!
//! In: a prediction and a reference of the same size, and the mask of the pixels that count, in that order. Out: one
//! number, or `None` where no pixel (or no window) counts. The type of a picture is its colour space, and this crate
//! changes no colours: the caller clips to 0..1 and encodes to sRGB. Only [`delta_e()`] and [`flip()`] clip as well.
//!
//! [`mse()`], [`mae()`], [`Psnr`] and [`delta_e()`] (CIEDE2000) compare pixels, [`mod@ssim`] compares 11x11 windows
//! (Wang et al. 2004), [`flip()`] compares what an observer sees at a distance (Andersson et al. 2020), and [`lpips`]
//! compares the responses of two trained networks (Zhang et al. 2018). The windows and filters of the last three reach
//! across the mask's edge: [`pixel`] holds the two ways to fill the pixels outside. FLIP has the reference's there, and
//! SSIM and LPIPS have two rules each ([`mask_rule`]). [`channel_scales()`] takes the scale of each channel away before
//! colours are compared. [`measured`] compares the means of regions with colours that were measured.
//!
//! Means are summed in `f64` in a fixed order, so the number of threads changes no bit. A NaN or infinite value inside
//! the mask is an error. Values outside the mask are not read, save the reference's where they fill the prediction.

pub mod delta_e;
pub mod flip;
pub mod lpips;
pub mod mask_rule;
pub mod measured;
pub mod mse;
pub mod pixel;
pub mod ssim;

pub use delta_e::{color_difference, delta_e};
pub use flip::{flip, flip_map};
pub use lpips::{Features, Lpips, Net};
pub use mse::{Psnr, channel_scales, mae, mse, scaled};
pub use pixel::{MetricError, Pixel};
pub use ssim::{MaskedSsim, ssim, ssim_black_fill, ssim_valid_windows};
