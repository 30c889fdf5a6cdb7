//! The two networks: their weights files and their layers.

use super::convolution::{Convolution, Shape};
use super::pool::Pool;

/// Name of the file with Alex' weights.
pub const ALEX_FILE_NAME: &str = "lpips-alex-v0.1.safetensors";
/// Name of the file with VGG's weights.
pub const VGG_FILE_NAME: &str = "lpips-vgg-v0.1.safetensors";
/// SHA-256 of the file with Alex' weights.
pub const ALEX_SHA256: &str = "b24653d691930ef38ebb65d7139a65227e482b1abcf5709f4805fe743fecb6c1";
/// SHA-256 of the file with VGG's weights.
pub const VGG_SHA256: &str = "5bd07b60a36a4a0588774f8b9e810e3ea3225925c30a6a73f171bb3932227524";

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

    /// The network's name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Alex => "alex",
            Self::Vgg => "vgg",
        }
    }

    /// Name of the weights file.
    pub const fn file_name(self) -> &'static str {
        match self {
            Self::Alex => ALEX_FILE_NAME,
            Self::Vgg => VGG_FILE_NAME,
        }
    }

    /// SHA-256 of the weights file, in lower-case hexadecimal.
    pub const fn expected_sha256(self) -> &'static str {
        match self {
            Self::Alex => ALEX_SHA256,
            Self::Vgg => VGG_SHA256,
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
