//! What metrics whose windows look across a mask's edge do outside the mask: the one place where mask rules differ.

use mateval_image::{Mask, Picture, SrgbRgb};
use mateval_metrics::lpips::MeanAndHalves;
use mateval_metrics::mask::pixel_count;
use mateval_metrics::{
    Features, Halves, Lpips, MaskedSsim, MetricError, Pixel, ssim_black_fill, ssim_halves_black_fill,
    ssim_halves_valid_windows, ssim_valid_windows,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What metrics whose windows look across a mask's edge do outside the mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaskRule {
    /// Both pictures are black outside; SSIM and LPIPS are averaged over the whole frame.
    BlackFill,
    /// SSIM over the windows that lie wholly inside; LPIPS of the prediction with the truth's pixels outside, its map summed
    /// over the picture and divided by the mask's pixels.
    Inside,
}

/// A value, none where nothing counts, and the number of pixels or windows that it is a mean over.
pub(crate) type Counted = (Option<f64>, usize);

impl MaskRule {
    pub(crate) fn ssim<P: Pixel>(
        self,
        prediction: &Picture<P>,
        reference: &Picture<P>,
        mask: &Mask,
    ) -> Result<Counted, MetricError> {
        Ok(match self {
            Self::BlackFill => (ssim_black_fill(prediction, reference, mask)?, pixel_count(mask)),
            Self::Inside => windows(ssim_valid_windows(prediction, reference, mask)?),
        })
    }

    /// [`Self::ssim`] of a noisy prediction.
    pub(crate) fn ssim_halves(
        self,
        prediction: Halves<'_, SrgbRgb>,
        reference: &Picture<SrgbRgb>,
        mask: &Mask,
    ) -> Result<Counted, MetricError> {
        Ok(match self {
            Self::BlackFill => (ssim_halves_black_fill(prediction, reference, mask)?, pixel_count(mask)),
            Self::Inside => windows(ssim_halves_valid_windows(prediction, reference, mask)?),
        })
    }

    /// None where nothing counts or the picture is too small for the network.
    pub(crate) fn lpips(
        self,
        lpips: &Lpips,
        prediction: &Picture<SrgbRgb>,
        reference: &Picture<SrgbRgb>,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        let distance = match self {
            Self::BlackFill => lpips.black_fill(prediction, reference, mask),
            Self::Inside => lpips.masked(prediction, reference, mask),
        };
        Ok(unless_too_small(distance)?.flatten())
    }

    /// What [`Self::lpips_halves`] can share between the masks of a reference.
    pub(crate) fn shared_features(
        self,
        lpips: &Lpips,
        reference: &Picture<SrgbRgb>,
    ) -> Result<Option<Features>, MetricError> {
        match self {
            Self::BlackFill => Ok(None),
            Self::Inside => unless_too_small(lpips.features(reference)),
        }
    }

    /// [`Self::lpips`] of a noisy prediction; `shared` comes from [`Self::shared_features`].
    pub(crate) fn lpips_halves(
        self,
        lpips: &Lpips,
        prediction: MeanAndHalves<'_>,
        reference: &Picture<SrgbRgb>,
        shared: Option<&Features>,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        let distance = match self {
            Self::BlackFill => match unless_too_small(lpips.black_filled_features(reference, mask))? {
                Some(features) => lpips.extrapolated_black_fill(prediction, &features, mask)?,
                None => None,
            },
            Self::Inside => match shared {
                Some(features) => lpips.extrapolated_masked(prediction, reference, features, mask)?,
                None => None,
            },
        };
        Ok(distance.map(|distance| distance.lpips))
    }
}

fn windows(inside: Option<MaskedSsim>) -> Counted {
    (inside.as_ref().map(|inside| inside.ssim), inside.map_or(0, |inside| inside.windows))
}

/// None for a picture that is too small for the network: it has no value, which is not an error.
fn unless_too_small<T>(found: Result<T, MetricError>) -> Result<Option<T>, MetricError> {
    match found {
        Err(MetricError::TooSmall { .. }) => Ok(None),
        other => other.map(Some),
    }
}
