//! What a method says of the input view: pictures of base colour, roughness and metallic, any of them.

use std::path::{Path, PathBuf};

use mateval_image::exr_io::{read_linear, read_scalar};
use mateval_image::{LinearRgb, Picture};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::open::Dataset;

use crate::adapter::Adapter;
use crate::error::BaselineError;

/// Numbers of a texel or pixel: linear red, green, blue; perceptual roughness; metallic.
pub type Values = [f32; 5];

/// Where estimates come from.
#[derive(Clone, Debug)]
pub enum EstimateSource {
    /// The truth's own albedo, roughness and metallic of the input view: what a perfect method would say (the paper's
    /// upper bound).
    Truth,
    /// The photo itself as base colour: what doing nothing gives.
    Input,
    /// A method's pictures, as its adapter says.
    Files {
        /// The folder that the adapter's paths begin in.
        folder: PathBuf,
        /// What its files are.
        adapter: Box<Adapter>,
    },
}

impl EstimateSource {
    /// For submission.json, as in `the truth of the input view`; of a method's pictures which there are.
    pub fn description(&self, dataset: &Dataset) -> String {
        match self {
            Self::Truth => "the truth of the input view".to_owned(),
            Self::Input => "the input picture itself".to_owned(),
            Self::Files { folder, adapter } => {
                let scenes: Vec<&str> = dataset.scenes.iter().map(|scene| scene.id.as_str()).collect();
                format!("the pictures of {} ({})", adapter.name, adapter.inventory(folder, &scenes))
            }
        }
    }

    /// For the method's name, as in `gt`.
    pub fn name(&self) -> &str {
        match self {
            Self::Truth => "gt",
            Self::Input => "input",
            Self::Files { adapter, .. } => &adapter.name,
        }
    }

    /// Reads the estimate of one scene. All its pictures have one size, which need not be the view's.
    pub fn read(&self, dataset: &Dataset, scene: &SceneFile) -> Result<Estimate, BaselineError> {
        let folder = dataset.folder(&scene.id);
        match self {
            Self::Truth => truth(&folder, input_view(&folder, scene)?)?.of_one_size(folder.path(), scene.id.as_str()),
            Self::Input => photo(&folder, input_view(&folder, scene)?, scene.exposure as f32),
            Self::Files { folder, adapter } => adapter.read(folder, scene.id.as_str()),
        }
    }
}

/// One scene's estimate. Pictures that are there have one size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Linear.
    pub base_color: Option<Picture<LinearRgb>>,
    /// Perceptual.
    pub roughness: Option<Picture<f32>>,
    /// 0 to 1.
    pub metallic: Option<Picture<f32>>,
}

/// Which of the three is said; what is not has no map, and stays at the format's default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Says {
    /// Linear red, green, blue.
    pub base_color: bool,
    /// Perceptual roughness.
    pub roughness: bool,
    /// Metallic.
    pub metallic: bool,
}

impl Estimate {
    /// Which pictures it has.
    pub fn says(&self) -> Says {
        Says {
            base_color: self.base_color.is_some(),
            roughness: self.roughness.is_some(),
            metallic: self.metallic.is_some(),
        }
    }

    /// Columns and rows; none where there is no picture.
    pub fn size(&self) -> Option<(usize, usize)> {
        let color = self.base_color.as_ref().map(|picture| (picture.width(), picture.height()));
        let scalar =
            |picture: &Option<Picture<f32>>| picture.as_ref().map(|picture| (picture.width(), picture.height()));
        color.or(scalar(&self.roughness)).or(scalar(&self.metallic))
    }

    /// Itself, where all its pictures have one size; `folder` and `scene` are for the error.
    pub(crate) fn of_one_size(self, folder: &Path, scene: &str) -> Result<Self, BaselineError> {
        let size = self.size().unwrap_or_default();
        let scalars = [&self.roughness, &self.metallic].into_iter().flatten();
        let sizes: Vec<(usize, usize)> = scalars.map(|picture| (picture.width(), picture.height())).collect();
        match sizes.into_iter().find(|other| *other != size) {
            None => Ok(self),
            Some(other) => {
                let (folder, scene) = (folder.to_owned(), scene.to_owned());
                Err(BaselineError::Sizes { folder, scene, sizes: [size, other] })
            }
        }
    }

    /// What it says at a pixel; 0 for what it does not say.
    pub fn at(&self, x: usize, y: usize) -> Values {
        let [r, g, b] = self.base_color.as_ref().map_or([0.0; 3], |picture| picture.get(x, y).0);
        let scalar = |picture: &Option<Picture<f32>>| picture.as_ref().map_or(0.0, |picture| picture.get(x, y));
        [r, g, b, scalar(&self.roughness), scalar(&self.metallic)]
    }
}

/// The view that estimates are of.
pub(crate) fn input_view<'a>(folder: &SceneFolder, scene: &'a SceneFile) -> Result<&'a View, BaselineError> {
    let missing = || BaselineError::NoInputView(folder.scene_file());
    scene.view(INPUT).ok_or_else(missing)
}

fn truth(folder: &SceneFolder, view: &View) -> Result<Estimate, BaselineError> {
    let folder = folder.truth_view(&view.id);
    Ok(Estimate {
        base_color: Some(read_linear(&folder.join("albedo.exr"))?),
        roughness: Some(read_scalar(&folder.join("roughness.exr"))?),
        metallic: Some(read_scalar(&folder.join("metallic.exr"))?),
    })
}

fn photo(folder: &SceneFolder, view: &View, exposure: f32) -> Result<Estimate, BaselineError> {
    let path = folder.view(&view.id).join("rgb.exr");
    if !path.is_file() {
        return Err(BaselineError::NoPhoto(path));
    }
    let shown = read_linear(&path)?.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (v * exposure).clamp(0.0, 1.0))));
    Ok(Estimate { base_color: Some(shown), ..Estimate::default() })
}
