//! The two networks, their weights as `mateval fetch lpips` writes them, and the features of a picture: the normalised
//! responses of a network's five stages.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use mateval_image::{Mask, Picture, SrgbRgb};
use rayon::prelude::*;
use safetensors::{Dtype, SafeTensors};
use sha2::{Digest, Sha256};

use super::tensor::{Convolution, PixelSet, Pool, Shape, Tensor, Window};
use crate::MetricError;
use crate::pixel::{Size, check_finite, size_of};

/// A network whose features LPIPS compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Net {
    /// AlexNet's five convolutions; fast, and recommended by the LPIPS authors for scoring.
    Alex,
    /// VGG-16's thirteen convolutions; about twenty times the work.
    Vgg,
}

impl Net {
    /// The metric's key in results.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Alex => "lpips_alex",
            Self::Vgg => "lpips_vgg",
        }
    }

    pub const fn name(self) -> &'static str {
        match self {
            Self::Alex => "alex",
            Self::Vgg => "vgg",
        }
    }

    /// Name of the weights file.
    pub const fn file_name(self) -> &'static str {
        match self {
            Self::Alex => "lpips-alex-v0.1.safetensors",
            Self::Vgg => "lpips-vgg-v0.1.safetensors",
        }
    }

    /// SHA-256 of the weights file, in lower-case hexadecimal.
    pub const fn expected_sha256(self) -> &'static str {
        match self {
            Self::Alex => "b24653d691930ef38ebb65d7139a65227e482b1abcf5709f4805fe743fecb6c1",
            Self::Vgg => "5bd07b60a36a4a0588774f8b9e810e3ea3225925c30a6a73f171bb3932227524",
        }
    }

    /// Least width and height of a picture in pixels. A smaller one would leave a stage without a pixel.
    pub const fn least_side(self) -> usize {
        match self {
            Self::Alex => 31,
            Self::Vgg => 16,
        }
    }

    /// The five stages, in order.
    pub(crate) fn stages(self) -> Vec<StageShape> {
        match self {
            Self::Alex => alex_stages(),
            Self::Vgg => vgg_stages(),
        }
    }
}

/// The layers of a stage: an optional pool, then convolutions.
#[derive(Debug)]
pub(crate) struct StageShape {
    pub(crate) pool: Option<Pool>,
    pub(crate) convolutions: Vec<Shape>,
}

/// AlexNet (Krizhevsky) as in torchvision, up to the last rectifier before its third pool.
fn alex_stages() -> Vec<StageShape> {
    let pool = Some(Pool { window: 3, stride: 2 });
    let stage = |pool, kernel, stride, padding, inputs, outputs| StageShape {
        pool,
        convolutions: vec![Shape { kernel, stride, padding, inputs, outputs }],
    };
    vec![
        stage(None, 11, 4, 2, 3, 64),
        stage(pool, 5, 1, 2, 64, 192),
        stage(pool, 3, 1, 1, 192, 384),
        stage(None, 3, 1, 1, 384, 256),
        stage(None, 3, 1, 1, 256, 256),
    ]
}

/// VGG configuration D (Simonyan and Zisserman), up to the last rectifier before its fifth pool.
fn vgg_stages() -> Vec<StageShape> {
    let stages: [(usize, usize, usize); 5] = [(2, 3, 64), (2, 64, 128), (3, 128, 256), (3, 256, 512), (3, 512, 512)];
    let shape = |inputs, outputs| Shape { kernel: 3, stride: 1, padding: 1, inputs, outputs };
    let stage = |(index, &(count, inputs, outputs)): (usize, &(usize, usize, usize))| StageShape {
        pool: (index > 0).then_some(Pool { window: 2, stride: 2 }),
        convolutions: (0..count).map(|i| shape(if i == 0 { inputs } else { outputs }, outputs)).collect(),
    };
    stages.iter().enumerate().map(stage).collect()
}

/// A stage with its weights.
#[derive(Debug)]
pub(crate) struct Stage {
    pub(crate) pool: Option<Pool>,
    pub(crate) convolutions: Vec<Convolution>,
    /// The weight of each channel's squared difference.
    pub(crate) linear: Vec<f32>,
}

/// Stages with their weights.
#[derive(Debug)]
pub(crate) struct Network {
    pub(crate) stages: Vec<Stage>,
}

impl Network {
    /// Whether every stage has at least one pixel for a picture of this width or height.
    pub(crate) fn fits(&self, side: usize) -> bool {
        let mut side = Some(side);
        for stage in &self.stages {
            side = stage.pool.map_or(side, |pool| side.and_then(|side| pool.output_side(side)));
            for convolution in &stage.convolutions {
                side = side.and_then(|side| convolution.shape.output_side(side));
            }
        }
        side.is_some()
    }
}

/// Larger than either file.
const MAX_BYTES: u64 = 64 << 20;

/// The network and the file's SHA-256. Fails unless the hash is the expected one.
pub(crate) fn load(net: Net, path: &Path) -> Result<(Network, String), MetricError> {
    let bytes = read_capped(path).map_err(|source| MetricError::WeightsIo { path: path.to_owned(), source })?;
    let found: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
    if found != net.expected_sha256() {
        return Err(MetricError::WeightsHash { path: path.to_owned(), expected: net.expected_sha256(), found });
    }
    Ok((parse(&net.stages(), &bytes)?, found))
}

/// The file's bytes, at most one more than [`MAX_BYTES`], so that a larger file fails the check of its hash.
fn read_capped(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The network with these stages, from the bytes of a safetensors file.
fn parse(shapes: &[StageShape], bytes: &[u8]) -> Result<Network, MetricError> {
    let file = SafeTensors::deserialize(bytes).map_err(|error| malformed(error.to_string()))?;
    let mut number = 0;
    let mut stages = Vec::with_capacity(shapes.len());
    for (index, shape) in shapes.iter().enumerate() {
        let mut convolutions = Vec::with_capacity(shape.convolutions.len());
        for &shape in &shape.convolutions {
            number += 1;
            convolutions.push(convolution(&file, number, shape)?);
        }
        let channels = shape.convolutions.last().map_or(0, |last| last.outputs);
        let linear = floats(&file, &format!("lin{}.weight", index + 1), &[channels])?;
        stages.push(Stage { pool: shape.pool, convolutions, linear });
    }
    Ok(Network { stages })
}

fn convolution(file: &SafeTensors<'_>, number: usize, shape: Shape) -> Result<Convolution, MetricError> {
    let kernel = [shape.outputs, shape.inputs, shape.kernel, shape.kernel];
    let weights = floats(file, &format!("conv{number}.weight"), &kernel)?;
    let bias = floats(file, &format!("conv{number}.bias"), &[shape.outputs])?;
    Ok(Convolution::new(shape, &weights, bias))
}

/// The tensor with this name. Fails unless it is `f32` and has this shape.
fn floats(file: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f32>, MetricError> {
    let tensor = file.tensor(name).map_err(|error| malformed(format!("'{name}': {error}")))?;
    if tensor.dtype() != Dtype::F32 || tensor.shape() != shape {
        let (dtype, found) = (tensor.dtype(), tensor.shape());
        return Err(malformed(format!("'{name}' is {dtype:?} {found:?}; expected F32 {shape:?}")));
    }
    let (values, _) = tensor.data().as_chunks::<4>();
    Ok(values.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect())
}

fn malformed(reason: String) -> MetricError {
    MetricError::WeightsMalformed { reason }
}

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

    pub fn width(&self) -> usize {
        self.size.0
    }

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

pub(crate) fn compute(net: Net, network: &Network, picture: &Picture<SrgbRgb>) -> Result<Features, MetricError> {
    let size = size_of(picture);
    check_size(net, network, size)?;
    check_finite("picture", picture, None)?;
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

/// The responses to a picture that differs from that of `base` in some pixels. For each stage also the pixels, by
/// index, that were computed: those that the difference reaches, as far as they are `needed`. All others are those of
/// `base`.
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

#[cfg(test)]
mod tests {
    use safetensors::tensor::TensorView;

    use super::*;

    fn tiny_shapes() -> Vec<StageShape> {
        let shape = Shape { kernel: 2, stride: 1, padding: 0, inputs: 1, outputs: 2 };
        vec![StageShape { pool: None, convolutions: vec![shape] }]
    }

    fn file(tensors: &[(&str, Dtype, Vec<usize>)]) -> Vec<u8> {
        let zeros = [0_u8; 256];
        let views = tensors.iter().map(|(name, dtype, shape)| {
            let bytes = shape.iter().product::<usize>() * if *dtype == Dtype::F64 { 8 } else { 4 };
            (*name, TensorView::new(*dtype, shape.clone(), &zeros[..bytes]).unwrap())
        });
        safetensors::serialize(views, None).unwrap()
    }

    fn good() -> Vec<(&'static str, Dtype, Vec<usize>)> {
        let kernel = ("conv1.weight", Dtype::F32, vec![2, 1, 2, 2]);
        vec![kernel, ("conv1.bias", Dtype::F32, vec![2]), ("lin1.weight", Dtype::F32, vec![2])]
    }

    #[test]
    fn a_file_that_fits_is_read_and_others_are_named() {
        assert_eq!(parse(&tiny_shapes(), &file(&good())).unwrap().stages[0].linear, [0.0, 0.0]);
        for (index, name) in ["conv1.weight", "conv1.bias", "lin1.weight"].into_iter().enumerate() {
            let (mut missing, mut other_shape, mut doubles) = (good(), good(), good());
            missing.remove(index);
            other_shape[index].2.push(1);
            doubles[index].1 = Dtype::F64;
            for tensors in [missing, other_shape, doubles] {
                let error = parse(&tiny_shapes(), &file(&tensors)).unwrap_err();
                assert!(matches!(&error, MetricError::WeightsMalformed { reason } if reason.contains(name)), "{error}");
            }
        }
    }

    #[test]
    fn a_truncated_file_is_malformed_at_every_length() {
        let whole = file(&good());
        for length in 0..whole.len() {
            let result = parse(&tiny_shapes(), &whole[..length]);
            assert!(matches!(result, Err(MetricError::WeightsMalformed { .. })), "{length} bytes");
        }
    }

    #[test]
    fn a_missing_and_another_file_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("weights.safetensors");
        let error = load(Net::Alex, &path).unwrap_err();
        assert!(matches!(error, MetricError::WeightsIo { .. }));
        std::fs::write(&path, file(&good())).unwrap();
        assert!(matches!(load(Net::Alex, &path), Err(MetricError::WeightsHash { .. })));
    }

    /// The tool that writes the files and the code that reads them agree on names and hashes.
    #[test]
    fn the_tool_has_the_same_names_and_hashes() {
        let tool = Path::new(env!("CARGO_MANIFEST_DIR")).join("../cli/src/fetch/lpips_weights.py");
        let tool = std::fs::read_to_string(tool).unwrap();
        for net in [Net::Alex, Net::Vgg] {
            assert!(tool.contains(&format!("\"{}\"", net.file_name())));
            assert!(tool.contains(&format!("\"{}\"", net.expected_sha256())));
        }
    }
}
