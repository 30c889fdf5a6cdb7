//! An estimate: what a method makes of the input view, as pictures of base colour, roughness and metallic.

use std::path::Path;

use mateval_image::{LinearRgb, Picture};

use crate::error::BaselineError;
use crate::placement::{Placement, Region};

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
    /// How the pictures lie on the input view, as an adapter states it; none without an adapter: they show all of it.
    pub placement: Option<Placement>,
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

    /// The part of a view of this width and height that the pictures show; `scene` is for the error. Fails without any
    /// picture, and where the pictures have other proportions than their placement allows.
    pub fn region(&self, scene: &str, view: (usize, usize)) -> Result<Region, BaselineError> {
        let scene = scene.to_owned();
        let Some(size) = self.size() else { return Err(BaselineError::EmptyEstimate(scene)) };
        let region = self.placement.unwrap_or_default().region(size, view);
        region.ok_or(BaselineError::Proportions { scene, size, view, adapted: self.placement.is_some() })
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Only who has an adapter is sent to it.
    #[test]
    fn the_advice_about_proportions_fits_the_kind_of_estimate() {
        let base_color = Some(Picture::filled(64, 64, LinearRgb([0.5; 3])));
        let refusal = |placement| {
            let estimate = Estimate { base_color: base_color.clone(), placement, ..Estimate::default() };
            estimate.region("room", (96, 72)).unwrap_err().to_string()
        };
        let (adapted, given) = (refusal(Some(Placement::Whole)), refusal(None));
        let both = "the estimate of scene 'room' has 64x64 pixels, the input view 96x72; expected the same proportions";
        assert!(adapted.starts_with(both) && given.starts_with(both), "{adapted}\n{given}");
        assert!(adapted.contains("placement = \"stretched\" at the top of the adapter"), "{adapted}");
        assert!(!given.contains("at the top of the adapter") && given.contains("scale it back"), "{given}");
    }
}
