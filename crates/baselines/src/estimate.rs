//! An estimate: what a method makes of the input view, as pictures of base colour, roughness and metallic, and how
//! these lie on the view.

use std::path::Path;

use glam::DVec2;
use mateval_dataset::SceneId;
use mateval_image::{LinearRgb, Picture};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    /// How the pictures lie on the input view, as an adapter states it; none without an adapter: they show all of it.
    pub placement: Option<Placement>,
}

/// Which maps a method gives. The others are not written, and score with the format's defaults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GivenMaps {
    pub base_color: bool,
    pub roughness: bool,
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
        let Some(size) = self.size() else {
            return Err(BaselineError::Unusable(format!("the estimate of scene '{scene}' holds no picture")));
        };
        let region = self.placement.unwrap_or_default().region(size, view);
        region.ok_or_else(|| other_proportions(scene, size, view, self.placement.is_some()))
    }

    /// Fails without base colour, for methods that paint it.
    pub(crate) fn needs_color(&self, scene: &SceneId) -> Result<(), BaselineError> {
        if self.base_color.is_some() {
            return Ok(());
        }
        let why = "has no base_color; give an estimate with base_color";
        Err(BaselineError::Unusable(format!("the estimate of scene '{scene}' {why}")))
    }

    /// Fails where its pictures differ in size; `folder` and `scene` are for the error.
    pub(crate) fn of_one_size(self, folder: &Path, scene: &str) -> Result<Self, BaselineError> {
        let size = self.size().unwrap_or_default();
        let scalars = [&self.roughness, &self.metallic].into_iter().flatten();
        let sizes: Vec<(usize, usize)> = scalars.map(|picture| (picture.width(), picture.height())).collect();
        match sizes.into_iter().find(|other| *other != size) {
            None => Ok(self),
            Some(other) => Err(BaselineError::Unusable(format!(
                "the estimate of scene '{scene}' in '{}' has pictures of {}x{} and of {}x{} pixels; expected one size",
                folder.display(),
                size.0,
                size.1,
                other.0,
                other.1
            ))),
        }
    }

    /// The values at a pixel; 0 for maps that the estimate lacks.
    pub fn at(&self, x: usize, y: usize) -> Values {
        let [r, g, b] = self.base_color.as_ref().map_or([0.0; 3], |picture| picture.get(x, y).0);
        let scalar = |picture: &Option<Picture<f32>>| picture.as_ref().map_or(0.0, |picture| picture.get(x, y));
        [r, g, b, scalar(&self.roughness), scalar(&self.metallic)]
    }
}

/// An estimate of this width and height has other proportions than the view; `adapted` where an adapter describes it.
pub(crate) fn other_proportions(
    scene: &str,
    size: (usize, usize),
    view: (usize, usize),
    adapted: bool,
) -> BaselineError {
    let advice = if adapted {
        "write placement = \"stretched\" at the top of the adapter, or placement = \"centre_crop\" if it cuts off what lies \
         outside its own proportions"
    } else {
        "scale it back to the view's proportions; if it cuts off a part of the view, save its pictures and lift them with \
         an adapter that states placement = \"centre_crop\": `mateval baseline nn --estimate FOLDER --adapter FILE.toml`"
    };
    BaselineError::Unusable(format!(
        "the estimate of scene '{scene}' has {}x{} pixels, the input view {}x{}; expected the same proportions, within 5 %; \
         if the method stretches the view to its own size, {advice}",
        size.0, size.1, view.0, view.1
    ))
}

/// Largest relative difference between the proportions of a [`Placement::Whole`] picture and the view, because methods
/// round sizes to multiples of 8 or 16.
const PROPORTIONS: f64 = 0.05;

/// How a picture lies on the input view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Placement {
    /// The picture shows the whole view and has its proportions within 5 %; others are refused.
    #[default]
    Whole,
    /// The picture shows the whole view, stretched to other proportions.
    Stretched,
    /// The picture shows the largest rectangle of its own proportions in the middle of the view. The rest of the view
    /// is not estimated.
    CentreCrop,
}

/// The rectangle of a view that a picture shows, in pixels of the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    pub corner: DVec2,
    pub size: DVec2,
}

impl Region {
    /// A whole view of this width and height.
    pub fn whole((width, height): (usize, usize)) -> Self {
        Self { corner: DVec2::ZERO, size: DVec2::new(width as f64, height as f64) }
    }

    /// The place in the view of the centre of pixel (`x`, `y`) of a picture of this width and height.
    pub fn place(&self, (width, height): (usize, usize), x: usize, y: usize) -> DVec2 {
        let share = |at: usize, size: f64, pixels: usize| (2 * at + 1) as f64 * size / (2 * pixels) as f64;
        self.corner + DVec2::new(share(x, self.size.x, width), share(y, self.size.y, height))
    }

    /// The pixel of a picture of this width and height that shows `place`, a place in the view; none outside the
    /// rectangle.
    pub fn pixel(&self, (width, height): (usize, usize), place: DVec2) -> Option<(usize, usize)> {
        let share = (place - self.corner) / self.size;
        let inside = share.cmpge(DVec2::ZERO).all() && share.cmplt(DVec2::ONE).all();
        let at = |share: f64, pixels: usize| ((share * pixels as f64) as usize).min(pixels - 1);
        inside.then(|| (at(share.x, width), at(share.y, height)))
    }
}

impl Placement {
    pub fn word(self) -> &'static str {
        match self {
            Self::Whole => "whole",
            Self::Stretched => "stretched",
            Self::CentreCrop => "centre_crop",
        }
    }

    /// Whether a picture is stretched although the placement does not say so: by more than rounding a side to a whole
    /// number explains. Both sizes are width and height in pixels.
    pub(crate) fn stretches_silently(self, picture: (usize, usize), view: (usize, usize)) -> bool {
        let [wide, high] = [picture.0 * view.1, picture.1 * view.0];
        self == Self::Whole && wide.abs_diff(high) >= view.0.max(view.1)
    }

    /// The part of a view of the size `view` that a picture of the size `picture` shows, both as width and height in
    /// pixels. Absent if the placement does not allow the picture's proportions.
    pub fn region(self, picture: (usize, usize), view: (usize, usize)) -> Option<Region> {
        let stretch = (picture.0 * view.1) as f64 / (picture.1 * view.0) as f64;
        let whole = Region::whole(view);
        match self {
            Self::Whole => (1.0 - PROPORTIONS..=1.0 + PROPORTIONS).contains(&stretch).then_some(whole),
            Self::Stretched => Some(whole),
            Self::CentreCrop => {
                let size = whole.size * DVec2::new(stretch.min(1.0), 1.0 / stretch.max(1.0));
                Some(Region { corner: (whole.size - size) / 2.0, size })
            }
        }
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

    #[test]
    fn a_crop_is_the_largest_rectangle_in_the_middle() {
        let region = |picture| Placement::CentreCrop.region(picture, (480, 270)).unwrap();
        assert_eq!(region((512, 512)), Region { corner: DVec2::new(105.0, 0.0), size: DVec2::splat(270.0) });
        assert_eq!(region((960, 270)), Region { corner: DVec2::new(0.0, 67.5), size: DVec2::new(480.0, 135.0) });
        assert_eq!(region((960, 540)), Region::whole((480, 270)));
    }

    #[test]
    fn only_whole_pictures_need_the_proportions_of_the_view() {
        let taken = |placement: Placement, picture| placement.region(picture, (480, 270)).is_some();
        for picture in [(480, 270), (1280, 704), (476, 266)] {
            assert!(taken(Placement::Whole, picture), "{picture:?}");
        }
        for picture in [(960, 512), (640, 480), (512, 512)] {
            assert!(!taken(Placement::Whole, picture) && taken(Placement::Stretched, picture), "{picture:?}");
        }
    }

    #[test]
    fn only_what_rounding_does_not_explain_is_stretched_silently() {
        let stretched = |placement: Placement, picture| placement.stretches_silently(picture, (480, 270));
        for picture in [(480, 272), (480, 264), (1280, 704), (476, 266)] {
            assert!(stretched(Placement::Whole, picture), "{picture:?}");
            assert!(!stretched(Placement::Stretched, picture) && !stretched(Placement::CentreCrop, picture));
        }
        // 768 columns and 432 rows are exact; 500 and 281 are the nearest to the proportions.
        for picture in [(480, 270), (960, 540), (768, 432), (500, 281)] {
            assert!(!stretched(Placement::Whole, picture), "{picture:?}");
        }
    }

    /// A pixel's centre lies in that pixel, for every placement, and places outside the crop have no pixel.
    #[test]
    fn places_and_pixels_are_inverse() {
        for placement in [Placement::Stretched, Placement::CentreCrop] {
            let size = (37, 51);
            let region = placement.region(size, (96, 72)).unwrap();
            for (x, y) in (0..37).flat_map(|x| (0..51).map(move |y| (x, y))) {
                assert_eq!(region.pixel(size, region.place(size, x, y)), Some((x, y)), "{placement:?}");
            }
        }
        let crop = Placement::CentreCrop.region((10, 10), (96, 72)).unwrap();
        assert_eq!(crop.pixel((10, 10), DVec2::new(11.9, 5.0)), None);
        assert_eq!(crop.pixel((10, 10), DVec2::new(84.0, 5.0)), None);
        assert!(crop.pixel((10, 10), DVec2::new(12.0, 5.0)).is_some());
    }
}
