//! What metrics whose windows look across a mask's edge do outside the mask: the one place where mask rules differ.

use std::sync::Arc;

use mateval_image::{Mask, Picture, SrgbRgb};
use mateval_metrics::mask::pixel_count;
use mateval_metrics::{Features, Lpips, MaskedSsim, MetricError, Pixel, ssim_black_fill, ssim_valid_windows};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::reference_features::ReferenceFeatures;

/// What metrics whose windows look across a mask's edge do outside the mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaskRule {
    /// Both pictures are black outside; SSIM and LPIPS are averaged over the whole frame.
    BlackFill,
    /// SSIM over the windows that lie wholly inside; LPIPS of the prediction with the truth's pixels outside, its map
    /// averaged over the mask.
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

    /// None where nothing counts or the picture is too small for the network. `features` are those of the reference.
    pub(crate) fn lpips(
        self,
        lpips: &Lpips,
        prediction: &Picture<SrgbRgb>,
        reference: &Picture<SrgbRgb>,
        features: &ReferenceFeatures,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        match (self.features(lpips, reference, features, mask)?, self) {
            (None, _) => Ok(None),
            (Some(features), Self::BlackFill) => lpips.black_fill_from(prediction, &features, mask),
            (Some(features), Self::Inside) => lpips.masked_from(prediction, &features, mask),
        }
    }

    /// The features of the reference that predictions are compared with; none where nothing counts or it is too small.
    fn features(
        self,
        lpips: &Lpips,
        reference: &Picture<SrgbRgb>,
        features: &ReferenceFeatures,
        mask: &Mask,
    ) -> Result<Option<Arc<Features>>, MetricError> {
        match self {
            _ if pixel_count(mask) == 0 => Ok(None),
            Self::BlackFill => features.black_filled(lpips, reference, mask),
            Self::Inside => features.whole(lpips, reference),
        }
    }
}

fn windows(inside: Option<MaskedSsim>) -> Counted {
    (inside.as_ref().map(|inside| inside.ssim), inside.map_or(0, |inside| inside.windows))
}
