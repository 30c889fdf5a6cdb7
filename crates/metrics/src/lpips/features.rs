//! The features of a picture: the normalised responses of a network's five stages.

use mateval_image::{Picture, SrgbRgb};
use rayon::prelude::*;

use super::net::{Net, Network};
use super::tensor::Tensor;
use crate::MetricError;
use crate::error::Size;
use crate::pixel::{check_finite, size_of};

/// LPIPS' scaling layer, for a picture in -1..1: `SHIFT` is subtracted from each channel, the result is divided by
/// `SCALE`. They are ImageNet's mean and standard deviation, converted from 0..1 to -1..1.
pub const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
/// See [`SHIFT`].
pub const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
/// Keeps a pixel at zero where all channels are zero.
pub const EPSILON: f64 = 1e-10;

/// The responses of the five stages to one picture, the channels of every pixel normalised to unit length.
#[derive(Clone, Debug)]
pub struct Features {
    net: Net,
    size: Size,
    pub(crate) stages: Vec<Tensor>,
}

impl Features {
    /// The network they come from.
    pub fn net(&self) -> Net {
        self.net
    }

    /// The picture's width.
    pub fn width(&self) -> usize {
        self.size.0
    }

    /// The picture's height.
    pub fn height(&self) -> usize {
        self.size.1
    }

    fn describe(&self) -> String {
        format!("{} at {}x{}", self.net.key(), self.size.0, self.size.1)
    }
}

/// Runs the network. Errors call the picture `name`.
pub(crate) fn compute(
    net: Net,
    network: &Network,
    name: &'static str,
    picture: &Picture<SrgbRgb>,
) -> Result<Features, MetricError> {
    let size = size_of(picture);
    if !(network.fits(size.0) && network.fits(size.1)) {
        return Err(MetricError::TooSmall { metric: net.key(), least: net.least_side(), found: size });
    }
    check_finite(name, picture, None)?;
    let mut flow = scaled(picture);
    let mut stages = Vec::with_capacity(network.stages.len());
    for stage in &network.stages {
        if let Some(pool) = stage.pool {
            flow = pool.apply(&flow);
        }
        for convolution in &stage.convolutions {
            flow = convolution.apply(&flow);
        }
        stages.push(normalized(&flow));
    }
    Ok(Features { net, size, stages })
}

/// Fails unless both come from `net` and from pictures of one size.
pub(crate) fn check_pair(net: Net, prediction: &Features, reference: &Features) -> Result<(), MetricError> {
    if prediction.net == net && reference.net == net && prediction.size == reference.size {
        return Ok(());
    }
    Err(MetricError::FeaturesDiffer { prediction: prediction.describe(), reference: reference.describe() })
}

/// From 0..1 to the range that the networks were trained on.
fn scaled(picture: &Picture<SrgbRgb>) -> Tensor {
    let scale =
        |&SrgbRgb(rgb): &SrgbRgb| -> [f32; 3] { std::array::from_fn(|c| (2.0 * rgb[c] - 1.0 - SHIFT[c]) / SCALE[c]) };
    let values = picture.pixels().iter().flat_map(scale).collect();
    Tensor { width: picture.width(), height: picture.height(), channels: 3, values }
}

/// Each pixel's channels divided by their length.
fn normalized(responses: &Tensor) -> Tensor {
    let mut tensor = responses.clone();
    tensor.values.par_chunks_mut(tensor.channels).with_min_len(256).for_each(|pixel| {
        let squares: f64 = pixel.iter().map(|&value| f64::from(value) * f64::from(value)).sum();
        let factor = 1.0 / (squares.sqrt() + EPSILON);
        pixel.iter_mut().for_each(|value| *value = (f64::from(*value) * factor) as f32);
    });
    tensor
}
