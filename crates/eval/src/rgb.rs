//! Metrics of rendered light, without the effect of render noise.
//!
//! Prediction and truth are two independent halves each, multiplied by the scene's exposure, clipped to 0..1 and
//! sRGB-encoded. MSE and PSNR use the halves of both; SSIM and LPIPS compare the prediction's halves with the truth's
//! denoised picture.

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::lpips::MeanAndHalves;
use mateval_metrics::{Features, Halves, Lpips, MetricError, NoiseFreeMse, Psnr, encoding_bias, noise_free_mse};

use crate::measure::{Measured, ValueNoise, rounded_lpips, ssim_metric};
use crate::metric::Metric;
use crate::protocol::Protocol;
use crate::truth::RgbTruth;

/// A picture under one light: two halves for MSE and PSNR, and one picture for display, SSIM and LPIPS.
pub struct EncodedLight {
    /// Linear, multiplied by the exposure.
    linear: [Picture<LinearRgb>; 2],
    halves: [Picture<SrgbRgb>; 2],
    /// The mean of a prediction's halves, or the truth's denoised picture.
    shown: Picture<SrgbRgb>,
}

/// A truth, with the features that LPIPS compares.
pub struct LightReference {
    light: EncodedLight,
    /// None without the network, where the mask rule needs other features, or for a picture that is too small.
    features: Option<Features>,
}

/// The metrics of one picture over one mask, and the MSE with its noise by block.
pub struct RgbMeasured {
    /// One value for each metric.
    pub values: Vec<Measured>,
    /// None where no pixel counts.
    pub mse: Option<NoiseFreeMse>,
}

fn exposed(picture: &Picture<LinearRgb>, exposure: f64) -> Picture<LinearRgb> {
    picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (f64::from(v) * exposure) as f32)))
}

impl EncodedLight {
    /// A prediction, from its halves.
    pub fn of_prediction(halves: &[Picture<LinearRgb>; 2], exposure: f64) -> Self {
        let mean = Picture::from_fn(halves[0].width(), halves[0].height(), |x, y| {
            let (LinearRgb(a), LinearRgb(b)) = (halves[0].get(x, y), halves[1].get(x, y));
            LinearRgb([0, 1, 2].map(|c| ((f64::from(a[c]) + f64::from(b[c])) / 2.0) as f32))
        });
        Self::new(halves, &mean, exposure)
    }

    /// The picture for display.
    pub(crate) fn shown(self) -> Picture<SrgbRgb> {
        self.shown
    }

    /// One half alone, exposed and encoded.
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
    /// Encodes a truth. Fails if a value is not finite.
    pub fn new(
        protocol: &Protocol,
        lpips: Option<&Lpips>,
        truth: &RgbTruth,
        exposure: f64,
    ) -> Result<Self, MetricError> {
        let light = EncodedLight::new(&truth.halves, &truth.shown, exposure);
        let features = match lpips {
            Some(lpips) => protocol.mask_rule.shared_features(lpips, &light.shown)?,
            None => None,
        };
        Ok(Self { light, features })
    }

    /// The truth's picture for display.
    pub(crate) fn shown(&self) -> &Picture<SrgbRgb> {
        &self.light.shown
    }

    /// The truth's halves, exposed and encoded.
    pub(crate) fn halves(&self) -> Halves<'_, SrgbRgb> {
        self.light.halves()
    }
}

/// MSE, PSNR, SSIM and (where its weights are loaded) LPIPS of a picture of light over the mask. `blocks` come from
/// [`crate::noise_blocks`]. Fails if sizes differ or a value that counts is not finite.
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
    values.push(ssim_metric(protocol.mask_rule.ssim_halves(prediction.halves(), &truth.shown, mask)?));
    if let Some(lpips) = lpips {
        let seen = MeanAndHalves { mean: &prediction.shown, a: &prediction.halves[0], b: &prediction.halves[1] };
        let shared = reference.features.as_ref();
        let distance = protocol.mask_rule.lpips_halves(lpips, seen, &truth.shown, shared, mask)?;
        values.push(rounded_lpips(protocol, distance, pixels));
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
    // To first order, if the error exceeds the noise.
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
