//! An estimate: what a method makes of the input view, as pictures of base colour, roughness and metallic.

use std::path::Path;

use mateval_image::{LinearRgb, Picture};

use crate::error::BaselineError;

/// Numbers of a texel or pixel: linear red, green, blue; perceptual roughness; metallic.
pub type Values = [f32; 5];

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
