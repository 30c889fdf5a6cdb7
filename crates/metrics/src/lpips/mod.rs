//! LPIPS v0.1: the distance between two pictures in the features of a trained network.
//!
//! Zhang, Isola, Efros, Shechtman, Wang: "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric",
//! 2018, as in version 0.1 of their code. The picture in -1..1 is shifted and scaled per channel and runs through the
//! convolutions of AlexNet or VGG-16; after each of five stages the channels of every pixel are normalised to unit
//! length. The distance is the mean over a stage's pixels of the weighted squared differences, summed over the stages.
//! Lower is better: 0 for equal pictures, rarely above 1. Pictures are sRGB-encoded, in 0..1.
//!
//! Convolutions are matrix products in `f32`, in blocks that do not depend on the number of threads: one machine gives
//! the same bits with any number. Processors with other vector units may differ in the last digits.

mod convolution;
mod distance;
mod features;
mod multiply;
mod net;
mod pool;
mod reach;
mod tensor;
mod weights;

use std::path::Path;

use mateval_image::{Mask, Picture, SrgbRgb};

pub use features::{EPSILON, Features, SCALE, SHIFT};
pub use net::{ALEX_FILE_NAME, ALEX_SHA256, Net, VGG_FILE_NAME, VGG_SHA256};

use crate::MetricError;
use crate::mask::{black_filled, pixel_count};
use crate::pixel::{check_finite, check_pair, check_size, size_of};
use distance::StageWeights;
use net::Network;

/// A network with its weights, ready to compare pictures.
///
/// While [`Lpips::features`] runs it takes, beside the picture, about 0.1 kB a pixel for Alex, 0.6 kB for VGG, plus a
/// few MB a thread. The resulting [`Features`] take 0.05 kB a pixel for Alex, 0.5 kB for VGG.
#[derive(Debug)]
pub struct Lpips {
    net: Net,
    sha256: String,
    network: Network,
}

impl Lpips {
    /// Reads the weights that `mateval fetch lpips` wrote.
    ///
    /// Fails if the file cannot be read, its hash is not the expected one, or it does not fit the network.
    pub fn load(net: Net, path: &Path) -> Result<Self, MetricError> {
        let (network, sha256) = weights::load(net, path)?;
        Ok(Self { net, sha256, network })
    }

    /// The network.
    pub fn net(&self) -> Net {
        self.net
    }

    /// The SHA-256 of the weights file, in lower-case hexadecimal.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// The distance over whole pictures.
    ///
    /// Fails if sizes differ, a side is below [`Net::least_side`] or a value is not finite.
    pub fn whole(&self, prediction: &Picture<SrgbRgb>, reference: &Picture<SrgbRgb>) -> Result<f64, MetricError> {
        check_pair(prediction, reference, None)?;
        self.distance(&self.features(prediction)?, &self.features(reference)?)
    }

    /// [`Lpips::whole`] of both pictures with black outside the mask (protocol `paper`). The larger the black part, the
    /// nearer the result is to 0. `None` where no pixel counts. Values outside the mask are not read. Fails as
    /// [`Lpips::whole`] does.
    pub fn black_fill(
        &self,
        prediction: &Picture<SrgbRgb>,
        reference: &Picture<SrgbRgb>,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        check_pair(prediction, reference, Some(mask))?;
        if pixel_count(mask) == 0 {
            return Ok(None);
        }
        self.black_fill_from(prediction, &self.black_filled_features(reference, mask)?, mask)
    }

    /// [`Lpips::black_fill`] from the reference's [`Lpips::black_filled_features`] under the same mask.
    pub fn black_fill_from(
        &self,
        prediction: &Picture<SrgbRgb>,
        reference: &Features,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        self.filled_distance(prediction, reference, mask, || {
            StageWeights::of_mean(&self.network, (mask.width(), mask.height()))
        })
    }

    /// The mean over the mask (protocol `mateval-3`): the prediction's pixels outside the mask are replaced by the
    /// reference's, each stage's map of distances is enlarged bilinearly to the picture's size, and the sum of the maps
    /// is averaged over the pixels of the mask. `None` where no pixel counts. The prediction is not read outside the
    /// mask, the reference is. Fails as [`Lpips::whole`] does.
    pub fn masked(
        &self,
        prediction: &Picture<SrgbRgb>,
        reference: &Picture<SrgbRgb>,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        check_pair(prediction, reference, Some(mask))?;
        if pixel_count(mask) == 0 {
            return Ok(None);
        }
        self.masked_from(prediction, &self.features_named("reference", reference)?, mask)
    }

    /// [`Lpips::masked`] from the reference's [`Lpips::features`].
    pub fn masked_from(
        &self,
        prediction: &Picture<SrgbRgb>,
        reference: &Features,
        mask: &Mask,
    ) -> Result<Option<f64>, MetricError> {
        self.filled_distance(prediction, reference, mask, || StageWeights::inside(&self.network, mask))
    }

    /// The weighted distance of the reference from itself with the prediction's pixels inside the mask. The networks run
    /// over those parts of the picture alone that these pixels change and the weights count. `None` where no pixel counts.
    fn filled_distance(
        &self,
        prediction: &Picture<SrgbRgb>,
        reference: &Features,
        mask: &Mask,
        weights: impl FnOnce() -> Vec<StageWeights>,
    ) -> Result<Option<f64>, MetricError> {
        features::check_reference(self.net, reference, size_of(prediction))?;
        check_size(size_of(prediction), "mask", size_of(mask))?;
        check_finite("prediction", prediction, Some(mask))?;
        if pixel_count(mask) == 0 {
            return Ok(None);
        }
        let input = features::filled_input(prediction, reference, mask);
        Ok(Some(distance::weighted(&self.network, &input, reference, &weights())))
    }

    /// The network's features of a picture with black outside the mask. Those of a reference serve every prediction
    /// under the same mask. Values outside the mask are not read. Fails as [`Lpips::features`] does, and if the mask
    /// has another size.
    pub fn black_filled_features(&self, picture: &Picture<SrgbRgb>, mask: &Mask) -> Result<Features, MetricError> {
        self.features(&black_filled(picture, mask)?)
    }

    /// The network's features of a picture. Those of a reference serve every prediction.
    ///
    /// Fails if a side is below [`Net::least_side`] or a value is not finite.
    pub fn features(&self, picture: &Picture<SrgbRgb>) -> Result<Features, MetricError> {
        self.features_named("picture", picture)
    }

    fn features_named(&self, name: &'static str, picture: &Picture<SrgbRgb>) -> Result<Features, MetricError> {
        features::compute(self.net, &self.network, name, picture)
    }

    /// [`Lpips::whole`] of two pictures from their features. Fails if networks or sizes differ.
    pub fn distance(&self, prediction: &Features, reference: &Features) -> Result<f64, MetricError> {
        features::check_pair(self.net, prediction, reference)?;
        Ok(distance::mean(&self.network, prediction, reference))
    }
}

#[cfg(test)]
mod tests;
