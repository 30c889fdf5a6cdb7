//! An estimate: what a method makes of the input view, as pictures of base colour, roughness and metallic.

use std::path::Path;

use mateval_image::{LinearRgb, Picture};

use crate::error::BaselineError;

/// The values of a texel or pixel: linear red, green and blue, perceptual roughness, metallic.
pub type Values = [f32; 5];

/// The estimate of one scene. All its pictures have one size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Linear base colour.
    pub base_color: Option<Picture<LinearRgb>>,
    /// Perceptual roughness.
    pub roughness: Option<Picture<f32>>,
    /// Metallic, 0 to 1.
    pub metallic: Option<Picture<f32>>,
}

/// Which maps a method gives. The others are not written, and score with the format's defaults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GivenMaps {
    /// Base colour.
    pub base_color: bool,
    /// Roughness.
    pub roughness: bool,
    /// Metallic.
    pub metallic: bool,
}

impl Estimate {
    /// Which maps the estimate has.
    pub fn given_maps(&self) -> GivenMaps {
        GivenMaps {
            base_color: self.base_color.is_some(),
            roughness: self.roughness.is_some(),
            metallic: self.metallic.is_some(),
        }
    }

    /// Width and height in pixels; none without any picture.
    pub fn size(&self) -> Option<(usize, usize)> {
        let color = self.base_color.as_ref().map(|picture| (picture.width(), picture.height()));
        let scalar =
            |picture: &Option<Picture<f32>>| picture.as_ref().map(|picture| (picture.width(), picture.height()));
        color.or(scalar(&self.roughness)).or(scalar(&self.metallic))
    }

    /// Fails where its pictures differ in size; `folder` and `scene` are for the error.
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

    /// The values at a pixel; 0 for maps that the estimate lacks.
    pub fn at(&self, x: usize, y: usize) -> Values {
        let [r, g, b] = self.base_color.as_ref().map_or([0.0; 3], |picture| picture.get(x, y).0);
        let scalar = |picture: &Option<Picture<f32>>| picture.as_ref().map_or(0.0, |picture| picture.get(x, y));
        [r, g, b, scalar(&self.roughness), scalar(&self.metallic)]
    }
}
