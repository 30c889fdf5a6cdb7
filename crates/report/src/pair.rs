//! The metrics of two picture files, with both mask rules.

use std::path::Path;

use mateval_image::{Mask, Picture, SrgbRgb, exr_io, png_io};
use mateval_metrics::mask_rule::{MaskRule, ReferenceFeatures};
use mateval_metrics::pixel::pixel_count;
use mateval_metrics::{Lpips, MetricError, Psnr, mse, ssim};
use schemars::JsonSchema;
use serde::Serialize;

use crate::error::ReportError;

/// The metrics of a pair of pictures. A value is null if no pixel or window counts; networks without weights are left
/// out.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PairValues {
    /// Mean squared error over all pixels.
    pub mse: Option<f64>,
    /// Its PSNR, dB.
    pub psnr: Option<f64>,
    /// SSIM of the whole picture.
    pub ssim: Option<f64>,
    /// LPIPS of the whole picture.
    pub lpips: Vec<NetValue>,
    /// The metrics inside the mask, if there is one.
    pub masked: Option<MaskedValues>,
}

/// The metrics of a pair of pictures inside a mask.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MaskedValues {
    /// The number of pixels of the mask.
    pub pixels: usize,
    /// Mean squared error over them.
    pub mse: Option<f64>,
    /// Its PSNR, dB.
    pub psnr: Option<f64>,
    /// SSIM over the windows that lie wholly inside the mask (`mateval-3`).
    pub ssim_inside: Option<f64>,
    /// The number of those windows.
    pub ssim_windows: usize,
    /// SSIM of both pictures blacked out outside (`paper`).
    pub ssim_black_fill: Option<f64>,
    /// LPIPS of the prediction with the reference's pixels outside, over the mask's pixels (`mateval-3`).
    pub lpips_inside: Vec<NetValue>,
    /// LPIPS of both pictures blacked out outside (`paper`).
    pub lpips_black_fill: Vec<NetValue>,
}

/// The distance by one network.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NetValue {
    /// `lpips_alex` or `lpips_vgg`.
    pub metric: String,
    /// The distance; null if the picture is too small for the network.
    pub value: Option<f64>,
}

/// A picture to compare: sRGB-encoded, with its bytes if it has 8 bits.
struct Loaded {
    srgb: Picture<SrgbRgb>,
    bytes: Option<Picture<SrgbRgb>>,
}

/// Reads both pictures (PNG unchanged, EXR clipped to 0..1 and sRGB-encoded) and compares them.
pub fn compare(
    prediction: &Path,
    reference: &Path,
    mask: Option<&Path>,
    nets: &[Lpips],
) -> Result<PairValues, ReportError> {
    let what = format!("'{}' against '{}'", prediction.display(), reference.display());
    let (prediction, reference) = (load(prediction)?, load(reference)?);
    let mask = mask.map(png_io::read_mask).transpose()?;
    values(&prediction, &reference, mask.as_ref(), nets).map_err(|source| ReportError::Metric { what, source })
}

fn load(path: &Path) -> Result<Loaded, ReportError> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr")) {
        return Ok(Loaded { srgb: exr_io::read_linear(path)?.to_srgb(), bytes: None });
    }
    let bytes = png_io::read_rgb_bytes(path)?.map(|rgb| SrgbRgb(rgb.map(f32::from)));
    Ok(Loaded { srgb: bytes.map(|p| SrgbRgb(p.0.map(|v| v / 255.0))), bytes: Some(bytes) })
}

fn values(
    prediction: &Loaded,
    reference: &Loaded,
    mask: Option<&Mask>,
    nets: &[Lpips],
) -> Result<PairValues, MetricError> {
    let (p, r) = (&prediction.srgb, &reference.srgb);
    let (mse, psnr) = errors(prediction, reference, None)?;
    let each = |value: &dyn Fn(&Lpips) -> Result<Option<f64>, MetricError>| {
        nets.iter()
            .map(|net| Ok(NetValue { metric: net.net().key().to_owned(), value: value(net)? }))
            .collect::<Result<Vec<_>, MetricError>>()
    };
    let masked = match mask {
        None => None,
        Some(mask) => {
            let (mse, psnr) = errors(prediction, reference, Some(mask))?;
            let (ssim_inside, ssim_windows) = MaskRule::Inside.ssim(p, r, mask)?;
            let lpips = |rule: MaskRule| each(&|net| rule.lpips(net, p, r, &ReferenceFeatures::default(), mask));
            Some(MaskedValues {
                pixels: pixel_count(mask),
                mse,
                psnr,
                ssim_inside,
                ssim_windows,
                ssim_black_fill: MaskRule::BlackFill.ssim(p, r, mask)?.0,
                lpips_inside: lpips(MaskRule::Inside)?,
                lpips_black_fill: lpips(MaskRule::BlackFill)?,
            })
        }
    };
    Ok(PairValues { mse, psnr, ssim: Some(ssim(p, r)?), lpips: each(&|net| net.whole(p, r).map(Some))?, masked })
}

/// MSE and PSNR. Bytes are compared as integers, since value / 255 rounds in f32 and changes the ninth digit.
fn errors(
    prediction: &Loaded,
    reference: &Loaded,
    mask: Option<&Mask>,
) -> Result<(Option<f64>, Option<f64>), MetricError> {
    let error = match (&prediction.bytes, &reference.bytes) {
        (Some(p), Some(r)) => mse(p, r, mask)?.map(|error| error / (255.0 * 255.0)),
        _ => mse(&prediction.srgb, &reference.srgb, mask)?,
    };
    let psnr = error.map(Psnr::from_mse).transpose()?;
    Ok((error, psnr.map(|psnr| psnr.db)))
}
