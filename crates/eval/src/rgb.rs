//! Metrics of rendered light, without the effect of render noise.
//!
//! Prediction and truth are multiplied by the scene's exposure, clipped to 0..1 and sRGB-encoded. MSE and PSNR use the
//! quarters of the prediction and the halves of the truth; SSIM and LPIPS compare the prediction with little noise
//! (`shown_render`) with the truth's picture `rgb.exr`.

use mateval_image::transfer::srgb_from_linear;
use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::{
    Halves, Lpips, MetricError, NoiseFreeMse, NoisyHalf, NoisyRender, Psnr, encoded_reference, noise_free_mse,
};

use crate::measure::{Measured, ValueNoise, rounded_lpips, ssim_metric};
use crate::metric::Metric;
use crate::protocol::{MaskRule, Protocol};
use crate::reference_features::ReferenceFeatures;
use crate::rendered_view::RenderedView;
use crate::shown_render::{ViewGuide, shown_render};
use crate::truth::TrueLight;

/// A prediction's picture under one light, encoded.
pub struct EncodedLight {
    /// For MSE and PSNR.
    render: NoisyRender<SrgbRgb>,
    /// Within 0..1, with little noise: for SSIM, LPIPS and display.
    shown: Picture<SrgbRgb>,
}

/// A truth, with the features that LPIPS compares.
pub struct LightReference {
    halves: [Picture<SrgbRgb>; 2],
    shown: Picture<SrgbRgb>,
    features: ReferenceFeatures,
}

/// The metrics of one picture over one mask, and the MSE with its noise by block.
pub struct RgbMeasured {
    /// One value for each metric.
    pub values: Vec<Measured>,
    /// None where no pixel counts.
    pub mse: Option<NoiseFreeMse>,
}

/// Clips and encodes a noisy value. Values below 0, which only noise has, continue the curve's straight part, so that
/// they still cancel those above.
pub fn encode_noisy(LinearRgb(rgb): LinearRgb) -> SrgbRgb {
    SrgbRgb(rgb.map(|v| if v < 0.0 { 12.92 * v } else { srgb_from_linear(v.min(1.0)) }))
}

fn mean_of(a: &Picture<LinearRgb>, b: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    Picture::from_fn(a.width(), a.height(), |x, y| {
        let (LinearRgb(a), LinearRgb(b)) = (a.get(x, y), b.get(x, y));
        LinearRgb([0, 1, 2].map(|c| ((f64::from(a[c]) + f64::from(b[c])) / 2.0) as f32))
    })
}

/// A prediction's quarters, encoded for MSE. Fails if sizes differ, which those of one render never do.
pub(crate) fn encoded_render(view: &RenderedView) -> Result<NoisyRender<SrgbRgb>, MetricError> {
    let quarters = [0, 1].map(|half| [0, 1].map(|quarter| view.quarter(half, quarter)));
    let half = |half: usize| NoisyHalf::encoded([&quarters[half][0], &quarters[half][1]], encode_noisy);
    let (mut a, mut b) = (half(0)?, half(1)?);
    // Each half with the converged companions of the other shows what the companions' own noise does.
    let means = [0, 1].map(|half| mean_of(&quarters[half][0], &quarters[half][1]));
    let other = |half: usize| view.with_other_companions(half, &means[half]);
    let shared = match (other(0), other(1)) {
        (Some(of_a), Some(of_b)) => {
            remove_bias(&mut a.estimate, &means[0], &of_a);
            remove_bias(&mut b.estimate, &means[1], &of_b);
            Some(Picture::from_fn(of_a.width(), of_a.height(), |x, y| {
                let [own, other] = [&means[0], &of_a].map(|picture| encode_noisy(picture.get(x, y)).0);
                SrgbRgb([0, 1, 2].map(|c| own[c] - other[c]))
            }))
        }
        _ => None,
    };
    Ok(NoisyRender { a, b, shared })
}

/// Takes off an encoded half the bias that the noise of its companions' converged pictures causes in encoding: the same as
/// for the truth's halves, from the half with its own companions and with those of the other half.
fn remove_bias(estimate: &mut Picture<SrgbRgb>, own: &Picture<LinearRgb>, other: &Picture<LinearRgb>) {
    let mean = mean_of(own, other);
    *estimate = Picture::from_fn(own.width(), own.height(), |x, y| {
        let [own, other, mean] = [own, other, &mean].map(|picture| encode_noisy(picture.get(x, y)).0);
        let encoded = estimate.get(x, y).0;
        SrgbRgb([0, 1, 2].map(|c| encoded[c] - (own[c] + other[c] - 2.0 * mean[c])))
    });
}

impl EncodedLight {
    /// Encodes a prediction's view. Fails if sizes differ, which those of one render never do.
    pub fn of_prediction(view: &RenderedView, guide: &ViewGuide<'_>) -> Result<Self, MetricError> {
        let [a, b] = [0, 1].map(|half| mean_of(&view.quarter(half, 0), &view.quarter(half, 1)));
        let shown = shown_render([&a, &b], guide).to_srgb();
        Ok(Self { render: encoded_render(view)?, shown })
    }

    /// The picture for display.
    pub(crate) fn shown(self) -> Picture<SrgbRgb> {
        self.shown
    }

    /// The squared error of pixel `k`, mean over channels, free of noise: the product of both halves' differences.
    pub(crate) fn noise_free_square(&self, reference: &LightReference, k: usize) -> f64 {
        let halves = [&self.render.a.estimate, &self.render.b.estimate];
        let difference = |half: usize, c: usize| {
            f64::from(halves[half].pixels()[k].0[c]) - f64::from(reference.halves[half].pixels()[k].0[c])
        };
        (0..3).map(|c| difference(0, c) * difference(1, c)).sum::<f64>() / 3.0
    }
}

impl LightReference {
    /// Encodes a truth. Fails if a value is not finite.
    pub fn new(protocol: &Protocol, lpips: Option<&Lpips>, truth: &TrueLight) -> Result<Self, MetricError> {
        let halves = Self::encoded_halves(truth)?;
        let shown = truth.shown.picture().to_srgb();
        let features = ReferenceFeatures::default();
        if let Some(lpips) = lpips.filter(|_| protocol.mask_rule == MaskRule::Inside) {
            features.whole(lpips, &shown)?;
        }
        Ok(Self { halves, shown, features })
    }

    /// The truth's halves alone, encoded.
    pub(crate) fn encoded_halves(truth: &TrueLight) -> Result<[Picture<SrgbRgb>; 2], MetricError> {
        let [a, b] = [0, 1].map(|half| truth.halves[half].picture());
        encoded_reference(Halves { a: &a, b: &b }, encode_noisy)
    }
}

/// MSE, PSNR, SSIM and (where its weights are loaded) LPIPS of a picture of light over the mask. `of_fits` are the same
/// picture under the lights that each of two streams was fitted to, if there was a fit; `blocks` come from
/// [`crate::noise_blocks`]. Fails if sizes differ or a value that counts is not finite.
pub fn rgb_metrics(
    protocol: &Protocol,
    lpips: Option<&Lpips>,
    prediction: &EncodedLight,
    of_fits: Option<&[NoisyRender<SrgbRgb>; 2]>,
    reference: &LightReference,
    mask: &Mask,
    blocks: &Picture<u32>,
) -> Result<RgbMeasured, MetricError> {
    let halves = Halves { a: &reference.halves[0], b: &reference.halves[1] };
    let mut mse = noise_free_mse(&prediction.render, halves, mask, blocks)?;
    if let (Some(mse), Some(of_fits)) = (&mut mse, of_fits) {
        let [a, b] = of_fits.each_ref().map(|render| noise_free_mse(render, halves, mask, blocks));
        mse.common = a?.zip(b?).map_or(0.0, |(a, b)| (a.mse - b.mse) / 2.0);
    }
    let pixels = mateval_metrics::mask::pixel_count(mask);
    let mut values = noise_free_values(mse.as_ref(), pixels)?;
    values.push(ssim_metric(protocol.mask_rule.ssim(&prediction.shown, &reference.shown, mask)?));
    if let Some(lpips) = lpips {
        let (shown, features) = (&prediction.shown, &reference.features);
        let distance = protocol.mask_rule.lpips(lpips, shown, &reference.shown, features, mask)?;
        values.push(rounded_lpips(protocol, distance, pixels));
    }
    Ok(RgbMeasured { values, mse })
}

fn noise_free_values(mse: Option<&NoiseFreeMse>, pixels: usize) -> Result<Vec<Measured>, MetricError> {
    let Some(mse) = mse else {
        return Ok([Metric::Mse, Metric::Psnr].map(|metric| Measured::plain(metric, None, pixels)).to_vec());
    };
    let psnr = mse.psnr()?;
    let standard_error = mse.standard_error();
    // To first order, if the error exceeds the noise.
    let slope = 10.0 / std::f64::consts::LN_10;
    let psnr_error = if psnr.exact { 0.0 } else { slope * standard_error / mse.bounded() };
    Ok(vec![
        Measured {
            noise: Some(ValueNoise { standard_error, lower_bound: false }),
            ..Measured::plain(Metric::Mse, Some(mse.mse), pixels)
        },
        Measured {
            exact: psnr.exact,
            noise: Some(ValueNoise { standard_error: psnr_error.min(Psnr::CAP_DB), lower_bound: psnr.lower_bound }),
            ..Measured::plain(Metric::Psnr, Some(psnr.db), pixels)
        },
    ])
}
