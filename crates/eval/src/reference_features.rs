//! The features of a reference picture that LPIPS compares, computed once for all predictions, masks and protocols.

use std::sync::{Arc, Mutex, PoisonError};

use mateval_image::{Mask, Picture, SrgbRgb};
use mateval_metrics::{Features, Lpips, MetricError};

/// The features of one reference picture, whole and with black outside of masks, as far as they have been asked for.
#[derive(Default)]
pub(crate) struct ReferenceFeatures(Mutex<Vec<(Option<Mask>, Arc<Features>)>>);

impl ReferenceFeatures {
    /// Those of the whole reference; none where it is too small for the network. The reference is the same at every call.
    pub(crate) fn whole(
        &self,
        lpips: &Lpips,
        reference: &Picture<SrgbRgb>,
    ) -> Result<Option<Arc<Features>>, MetricError> {
        self.of(None, || lpips.features(reference))
    }

    /// Those of the reference with black outside the mask.
    pub(crate) fn black_filled(
        &self,
        lpips: &Lpips,
        reference: &Picture<SrgbRgb>,
        mask: &Mask,
    ) -> Result<Option<Arc<Features>>, MetricError> {
        self.of(Some(mask), || lpips.black_filled_features(reference, mask))
    }

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
