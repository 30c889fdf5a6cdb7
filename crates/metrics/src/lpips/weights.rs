//! Reads the weights file that `mateval fetch lpips` writes.
//!
//! A safetensors file of little-endian `f32`: `convN.weight` [out, in, height, width], `convN.bias` [out],
//! `linN.weight` [channels], N from 1.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use safetensors::{Dtype, SafeTensors};
use sha2::{Digest, Sha256};

use super::convolution::{Convolution, Shape};
use super::net::{Net, Network, Stage, StageShape};
use crate::MetricError;

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
