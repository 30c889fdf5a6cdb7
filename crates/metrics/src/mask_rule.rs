//! Mask rules: how SSIM and LPIPS, whose windows reach across a mask's edge, treat the pixels outside.

use std::sync::{Arc, Mutex, PoisonError};

use mateval_image::{Mask, Picture, SrgbRgb};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pixel::{black_filled, pixel_count};
use crate::{Features, Lpips, MetricError, Pixel, ssim_black_fill, ssim_valid_windows};

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
pub type Counted = (Option<f64>, usize);

impl MaskRule {
    pub fn ssim<P: Pixel>(
        self,
        prediction: &Picture<P>,
        reference: &Picture<P>,
        mask: &Mask,
    ) -> Result<Counted, MetricError> {
        Ok(match self {
            Self::BlackFill => (ssim_black_fill(prediction, reference, mask)?, pixel_count(mask)),
            Self::Inside => {
                ssim_valid_windows(prediction, reference, mask)?.map_or((None, 0), |s| (Some(s.ssim), s.windows))
            }
        })
    }

    /// None where nothing counts or the picture is too small for the network. `features` are those of the reference.
    pub fn lpips(
        self,
        lpips: &Lpips,
        prediction: &Picture<SrgbRgb>,
        reference: &Picture<SrgbRgb>,
        features: &ReferenceFeatures,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        if pixel_count(mask) == 0 {
            return Ok(None);
        }
        let features = match self {
            Self::BlackFill => features.of(Some(mask), || lpips.features(&black_filled(reference, mask)?)),
            Self::Inside => features.of(None, || lpips.features(reference)),
        };
        match (features?, self) {
            (None, _) => Ok(None),
            (Some(features), Self::BlackFill) => lpips.black_fill(prediction, &features, mask),
            (Some(features), Self::Inside) => lpips.inside(prediction, &features, mask),
        }
    }
}

/// The features of one reference picture, whole and with black outside of masks, as far as they have been asked for.
#[derive(Default)]
pub struct ReferenceFeatures(Mutex<Vec<(Option<Mask>, Arc<Features>)>>);

impl ReferenceFeatures {
    /// Those of the whole reference, or of the reference with black outside the mask; absent if it is too small for the
    /// network. The reference is the same at every call.
    fn of(
        &self,
        mask: Option<&Mask>,
        compute: impl FnOnce() -> Result<Features, MetricError>,
    ) -> Result<Option<Arc<Features>>, MetricError> {
        // A list that another thread was extending when it panicked is whole: an entry is added in one step.
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, features)) = known().iter().find(|(known, _)| known.as_ref() == mask) {
            return Ok(Some(features.clone()));
        }
        // Not under the lock: the network runs on rayon's threads, and a thread that waits for them may take up another
        // job that asks for the same features. Two threads may compute the same.
        let features = match compute() {
            // A picture that is too small for the network has no value, which is not an error.
            Err(MetricError::TooSmall { .. }) => return Ok(None),
            other => Arc::new(other?),
        };
        known().push((mask.cloned(), features.clone()));
        Ok(Some(features))
    }
}
