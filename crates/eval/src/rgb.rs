//! Renders compared with the truth's: everything that is measured on light, freed of noise.
//!
//! Pictures come as two independent halves. They are multiplied by the scene's exposure, clipped to 0..1 and sRGB-encoded.
//! MSE and PSNR come from the halves of both; SSIM and LPIPS compare the prediction's halves with the truth's denoised
//! picture.

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::lpips::MeanAndHalves;
use mateval_metrics::{
    Features, Halves, Lpips, MetricError, NoiseFreeMse, Psnr, encoding_bias, noise_free_mse, ssim_halves_black_fill,
    ssim_halves_valid_windows,
};

use crate::measure::{Measured, ValueNoise, rounded_lpips};
use crate::metric::Metric;
use crate::protocol::{MaskRule, Protocol};
use crate::truth::RgbTruth;

/// One light's picture as two halves and as people see it.
pub struct EncodedLight {
    /// Linear, multiplied by the exposure.
    linear: [Picture<LinearRgb>; 2],
    halves: [Picture<SrgbRgb>; 2],
    /// Of a prediction the halves' mean, of a truth its denoised picture.
    shown: Picture<SrgbRgb>,
}

/// A truth, with what LPIPS sees in it.
pub struct LightReference {
    light: EncodedLight,
    /// None without the network, where the mask rule wants others, or for a picture that is too small.
    features: Option<Features>,
}

/// What was measured of one picture and mask, and the MSE with its noise by block.
pub struct RgbMeasured {
    /// Metric by metric.
    pub values: Vec<Measured>,
    /// None where no pixel counts.
    pub mse: Option<NoiseFreeMse>,
}

fn exposed(picture: &Picture<LinearRgb>, exposure: f64) -> Picture<LinearRgb> {
    picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (f64::from(v) * exposure) as f32)))
}

impl EncodedLight {
    /// A prediction's, from its halves.
    pub fn of_prediction(halves: &[Picture<LinearRgb>; 2], exposure: f64) -> Self {
        let mean = Picture::from_fn(halves[0].width(), halves[0].height(), |x, y| {
            let (LinearRgb(a), LinearRgb(b)) = (halves[0].get(x, y), halves[1].get(x, y));
            LinearRgb([0, 1, 2].map(|c| ((f64::from(a[c]) + f64::from(b[c])) / 2.0) as f32))
        });
        Self::new(halves, &mean, exposure)
    }

    /// As people see it.
    pub(crate) fn shown(self) -> Picture<SrgbRgb> {
        self.shown
    }

    /// One half alone, as it is compared.
    pub(crate) fn half(picture: &Picture<LinearRgb>, exposure: f64) -> Picture<SrgbRgb> {
        exposed(picture, exposure).to_srgb()
    }

    fn new(halves: &[Picture<LinearRgb>; 2], shown: &Picture<LinearRgb>, exposure: f64) -> Self {
        let linear = [0, 1].map(|half| exposed(&halves[half], exposure));
        let encoded = [0, 1].map(|half| linear[half].to_srgb());
        Self { linear, halves: encoded, shown: Self::half(shown, exposure) }
    }

    /// The squared error of pixel `k`, mean over channels, free of noise: the product of both halves' differences.
    pub(crate) fn noise_free_square(&self, reference: &LightReference, k: usize) -> f64 {
        let truth = &reference.light;
        let difference = |half: usize, c: usize| {
            f64::from(self.halves[half].pixels()[k].0[c]) - f64::from(truth.halves[half].pixels()[k].0[c])
        };
        (0..3).map(|c| difference(0, c) * difference(1, c)).sum::<f64>() / 3.0
    }

    fn halves(&self) -> Halves<'_, SrgbRgb> {
        Halves { a: &self.halves[0], b: &self.halves[1] }
    }

    fn linear(&self) -> Halves<'_, LinearRgb> {
        Halves { a: &self.linear[0], b: &self.linear[1] }
    }
}

impl LightReference {
    /// A truth's. Fails where a value is not finite.
    pub fn new(
        protocol: &Protocol,
        lpips: Option<&Lpips>,
        truth: &RgbTruth,
        exposure: f64,
    ) -> Result<Self, MetricError> {
        let light = EncodedLight::new(&truth.halves, &truth.shown, exposure);
        let features = match (lpips, protocol.mask_rule) {
            (Some(lpips), MaskRule::Inside) => or_too_small(lpips.features(&light.shown))?,
            _ => None,
        };
        Ok(Self { light, features })
    }

    /// The truth as people see it.
    pub(crate) fn shown(&self) -> &Picture<SrgbRgb> {
        &self.light.shown
    }

    /// The truth's halves, as they are compared.
    pub(crate) fn halves(&self) -> Halves<'_, SrgbRgb> {
        self.light.halves()
    }
}

/// MSE, PSNR, SSIM and (where its weights are there) LPIPS of a picture of light over the mask. `blocks` are those of
/// [`crate::noise_blocks`]. Fails where sizes differ or a value that counts is not finite.
pub fn rgb_metrics(
    protocol: &Protocol,
    lpips: Option<&Lpips>,
    prediction: &EncodedLight,
    reference: &LightReference,
    mask: &Mask,
    blocks: &Picture<u32>,
) -> Result<RgbMeasured, MetricError> {
    let truth = &reference.light;
    let mse = noise_free_mse(prediction.halves(), truth.halves(), mask, blocks)?;
    let encode =
        |LinearRgb(rgb): LinearRgb| SrgbRgb(rgb.map(|v| mateval_image::transfer::srgb_from_linear(v.clamp(0.0, 1.0))));
    let bias = encoding_bias(prediction.linear(), truth.linear(), encode, mask, blocks)?;
    let pixels = mateval_metrics::mask::pixel_count(mask);
    let mut values = noise_free_values(mse.as_ref(), bias.map(|bias| (bias.estimate, bias.bound)), pixels)?;
    values.push(match protocol.mask_rule {
        MaskRule::BlackFill => {
            let value = ssim_halves_black_fill(prediction.halves(), &truth.shown, mask)?;
            Measured::plain(Metric::Ssim, value, pixels)
        }
        MaskRule::Inside => {
            let inside = ssim_halves_valid_windows(prediction.halves(), &truth.shown, mask)?;
            Measured::plain(Metric::Ssim, inside.as_ref().map(|s| s.ssim), inside.map_or(0, |s| s.windows))
        }
    });
    if let Some(lpips) = lpips {
        let seen = MeanAndHalves { mean: &prediction.shown, a: &prediction.halves[0], b: &prediction.halves[1] };
        let distance = match (protocol.mask_rule, &reference.features) {
            (MaskRule::BlackFill, _) => match or_too_small(lpips.black_filled_features(&truth.shown, mask))? {
                Some(features) => lpips.extrapolated_black_fill(seen, &features, mask)?,
                None => None,
            },
            (MaskRule::Inside, Some(features)) => lpips.extrapolated_masked(seen, &truth.shown, features, mask)?,
            (MaskRule::Inside, None) => None,
        };
        values.push(rounded_lpips(protocol, distance.map(|distance| distance.lpips), pixels));
    }
    Ok(RgbMeasured { values, mse })
}

fn noise_free_values(
    mse: Option<&NoiseFreeMse>,
    bias: Option<(f64, f64)>,
    pixels: usize,
) -> Result<Vec<Measured>, MetricError> {
    let (Some(mse), Some((bias, bias_bound))) = (mse, bias) else {
        return Ok([Metric::Mse, Metric::Psnr].map(|metric| Measured::plain(metric, None, pixels)).to_vec());
    };
    let noise = |standard_error: f64| ValueNoise { standard_error, bias: None, bias_bound: None, lower_bound: false };
    let psnr = mse.psnr()?;
    // To first order, where the error is more than noise.
    let slope = 10.0 / std::f64::consts::LN_10;
    let psnr_error = if mse.mse > 0.0 { slope * mse.standard_error() / mse.mse } else { Psnr::CAP_DB };
    Ok(vec![
        Measured {
            noise: Some(ValueNoise { bias: Some(bias), bias_bound: Some(bias_bound), ..noise(mse.standard_error()) }),
            ..Measured::plain(Metric::Mse, Some(mse.mse), pixels)
        },
        Measured {
            exact: psnr.exact,
            noise: Some(ValueNoise { lower_bound: psnr.lower_bound, ..noise(psnr_error.min(Psnr::CAP_DB)) }),
            ..Measured::plain(Metric::Psnr, Some(psnr.db), pixels)
        },
    ])
}

/// The network has no value for a picture that is too small: missing, not wrong.
fn or_too_small<T>(found: Result<T, MetricError>) -> Result<Option<T>, MetricError> {
    match found {
        Err(MetricError::TooSmall { .. }) => Ok(None),
        other => other.map(Some),
    }
}
