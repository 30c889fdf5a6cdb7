//! The features of a picture: the normalised responses of a network's five stages.

use mateval_image::{Mask, Picture, SrgbRgb};
use rayon::prelude::*;

use super::net::{Net, Network, Stage};
use super::pool::Pool;
use super::reach::{PixelSet, Window};
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

/// The responses of the five stages to one picture, with what normalises the channels of every pixel to unit length.
///
/// They serve two purposes: to be compared with those of another picture, and to save work for one that differs in some
/// of its pixels only.
#[derive(Clone, Debug)]
pub struct Features {
    net: Net,
    size: Size,
    /// The picture, shifted and scaled for the network.
    pub(crate) input: Tensor,
    pub(crate) stages: Vec<Responses>,
}

/// The responses of one stage.
#[derive(Clone, Debug)]
pub(crate) struct Responses {
    pub(crate) tensor: Tensor,
    /// The reciprocal of each pixel's length.
    factors: Vec<f64>,
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

impl Responses {
    pub(crate) fn pixels(&self) -> usize {
        self.factors.len()
    }

    /// The channels of a pixel, normalised to unit length.
    pub(crate) fn normalized(&self, pixel: usize) -> impl Iterator<Item = f32> + '_ {
        let (channels, factor) = (self.tensor.channels, self.factors[pixel]);
        let values = &self.tensor.values[pixel * channels..(pixel + 1) * channels];
        values.iter().map(move |&value| (f64::from(value) * factor) as f32)
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
    check_size(net, network, size)?;
    check_finite(name, picture, None)?;
    let all = |layer: &Layer| PixelSet::filled(layer.width, layer.height, true);
    let sets: Vec<Vec<PixelSet>> = layers(network, size).iter().map(|stage| stage.iter().map(all).collect()).collect();
    let input = scaled(picture);
    let stages = run(network, &input, &sets, None);
    Ok(Features { net, size, input, stages })
}

/// Fails unless every stage has a pixel for a picture of this size.
pub(crate) fn check_size(net: Net, network: &Network, size: Size) -> Result<(), MetricError> {
    if network.fits(size.0) && network.fits(size.1) {
        return Ok(());
    }
    Err(MetricError::TooSmall { metric: net.key(), least: net.least_side(), found: size })
}

/// The responses to a picture that differs from that of `base` in some pixels. For each stage also the pixels, by index,
/// that were computed: those that the difference reaches, as far as they are `needed`. All others are those of `base`.
pub(crate) fn compute_changed(
    network: &Network,
    input: &Tensor,
    base: &Features,
    needed: &[PixelSet],
) -> Vec<(Responses, Vec<usize>)> {
    let sets = sets_of_change(network, &differing(input, &base.input), needed);
    let stages = run(network, input, &sets, Some(base));
    let last = sets.iter().map(|stage| stage.last().expect("a stage has a convolution").pixels());
    stages.into_iter().zip(last).collect()
}

/// A layer's window on the one before, and the size of its output.
struct Layer {
    window: Window,
    width: usize,
    height: usize,
}

/// The layers of each stage for a picture of this size, which fits the network.
fn layers(network: &Network, (mut width, mut height): Size) -> Vec<Vec<Layer>> {
    let mut layer = |window: Window| {
        let side = |input| window.output_side(input).expect("the picture's size was checked against the network");
        (width, height) = (side(width), side(height));
        Layer { window, width, height }
    };
    let windows = |stage: &Stage| -> Vec<Window> {
        let convolutions = stage.convolutions.iter().map(|convolution| convolution.shape.window());
        stage.pool.iter().map(Pool::window).chain(convolutions).collect()
    };
    network.stages.iter().map(|stage| windows(stage).into_iter().map(&mut layer).collect()).collect()
}

/// The width and height of each stage for a picture of this size, which fits the network.
pub(crate) fn stage_sizes(network: &Network, size: Size) -> Vec<Size> {
    let last = |stage: &Vec<Layer>| stage.last().map(|layer| (layer.width, layer.height));
    layers(network, size).iter().map(|stage| last(stage).expect("a stage has a convolution")).collect()
}

/// The pixels in which two inputs of one size differ.
fn differing(a: &Tensor, b: &Tensor) -> PixelSet {
    let pairs = a.values.chunks(a.channels).zip(b.values.chunks(b.channels));
    PixelSet { width: a.width, height: a.height, holds: pairs.map(|(a, b)| a != b).collect() }
}

/// The pixels that each layer must compute: a stage those that the change reaches and that it or a later stage needs, a
/// layer within a stage those that the next one reads.
fn sets_of_change(network: &Network, changed: &PixelSet, needed: &[PixelSet]) -> Vec<Vec<PixelSet>> {
    let layers = layers(network, (changed.width, changed.height));
    let mut reached = changed.clone();
    let mut reached_by_stage = Vec::new();
    for stage in &layers {
        for layer in stage {
            reached = reached.reaching(layer.window, layer.width, layer.height);
        }
        reached_by_stage.push(reached.clone());
    }
    let mut sets = vec![Vec::new(); layers.len()];
    let mut read: Option<PixelSet> = None;
    for (at, stage) in layers.iter().enumerate().rev() {
        let mut set = needed[at].clone();
        read.iter().for_each(|read| set.add(read));
        set = set.shared(&reached_by_stage[at]);
        for (index, layer) in stage.iter().enumerate().rev() {
            sets[at].push(set.clone());
            let before = match (index.checked_sub(1), at.checked_sub(1)) {
                (Some(index), _) => Some(&stage[index]),
                (None, Some(at)) => layers[at].last(),
                (None, None) => None,
            };
            let (width, height) = before.map_or((changed.width, changed.height), |layer| (layer.width, layer.height));
            set = set.read(layer.window, width, height);
        }
        sets[at].reverse();
        read = Some(set);
    }
    sets
}

/// Computes the pixels of `sets`, layer by layer; the other pixels of a stage are those of `base`.
fn run(network: &Network, input: &Tensor, sets: &[Vec<PixelSet>], base: Option<&Features>) -> Vec<Responses> {
    let mut stages: Vec<Responses> = Vec::with_capacity(network.stages.len());
    for (at, (stage, sets)) in network.stages.iter().zip(sets).enumerate() {
        let base = base.map(|base| &base.stages[at]);
        let mut sets = sets.iter();
        let mut inner: Option<Tensor> = None;
        let mut next = || sets.next().expect("one set for each layer");
        if let Some(pool) = stage.pool {
            let set = next();
            let from = stages.last().map_or(input, |stage| &stage.tensor);
            let mut output = Tensor::zeros(set.width, set.height, from.channels);
            pool.apply(from, &set.pixels(), &mut output);
            inner = Some(output);
        }
        let mut computed = Vec::new();
        for (index, convolution) in stage.convolutions.iter().enumerate() {
            let set = next();
            let is_last = index + 1 == stage.convolutions.len();
            let mut output = match base.filter(|_| is_last) {
                Some(base) => base.tensor.clone(),
                None => Tensor::zeros(set.width, set.height, convolution.shape.outputs),
            };
            computed = set.pixels();
            let from = inner.as_ref().or(stages.last().map(|stage| &stage.tensor)).unwrap_or(input);
            convolution.apply(from, &computed, &mut output);
            inner = Some(output);
        }
        let tensor = inner.expect("a stage has a convolution");
        let factors = factors(&tensor, &computed, base);
        stages.push(Responses { tensor, factors });
    }
    stages
}

/// The reciprocal of each pixel's length; of pixels that were not computed, that of `base`.
fn factors(tensor: &Tensor, computed: &[usize], base: Option<&Responses>) -> Vec<f64> {
    let factor = |&pixel: &usize| {
        let values = &tensor.values[pixel * tensor.channels..(pixel + 1) * tensor.channels];
        let squares: f64 = values.iter().map(|&value| f64::from(value) * f64::from(value)).sum();
        1.0 / (squares.sqrt() + EPSILON)
    };
    let found: Vec<f64> = computed.par_iter().with_min_len(256).map(factor).collect();
    let mut factors = base.map_or_else(|| vec![0.0; tensor.width * tensor.height], |base| base.factors.clone());
    computed.iter().zip(found).for_each(|(&pixel, factor)| factors[pixel] = factor);
    factors
}

/// Fails unless both come from `net` and from pictures of one size.
pub(crate) fn check_pair(net: Net, prediction: &Features, reference: &Features) -> Result<(), MetricError> {
    if prediction.net == net && reference.net == net && prediction.size == reference.size {
        return Ok(());
    }
    Err(MetricError::FeaturesDiffer { prediction: prediction.describe(), reference: reference.describe() })
}

/// Fails unless a reference comes from `net` and from a picture of the prediction's size.
pub(crate) fn check_reference(net: Net, reference: &Features, prediction: Size) -> Result<(), MetricError> {
    if reference.net == net && reference.size == prediction {
        return Ok(());
    }
    let prediction = format!("{} at {}x{}", net.key(), prediction.0, prediction.1);
    Err(MetricError::FeaturesDiffer { prediction, reference: reference.describe() })
}

/// From 0..1 to the range that the networks were trained on.
fn scaled(picture: &Picture<SrgbRgb>) -> Tensor {
    let values = picture.pixels().iter().flat_map(|pixel| scaled_pixel(*pixel)).collect();
    Tensor { width: picture.width(), height: picture.height(), channels: 3, values }
}

fn scaled_pixel(SrgbRgb(rgb): SrgbRgb) -> [f32; 3] {
    std::array::from_fn(|c| (2.0 * rgb[c] - 1.0 - SHIFT[c]) / SCALE[c])
}

/// The input of the network for a picture inside the mask, and for the picture of `base` outside.
pub(crate) fn filled_input(picture: &Picture<SrgbRgb>, base: &Features, mask: &Mask) -> Tensor {
    let mut input = base.input.clone();
    let pixels = input.values.chunks_mut(3).zip(picture.pixels().iter().zip(mask.pixels()));
    for (values, (pixel, _)) in pixels.filter(|(_, (_, counts))| **counts) {
        values.copy_from_slice(&scaled_pixel(*pixel));
    }
    input
}
