//! How the pictures of an estimate lie on the input view.

use glam::DVec2;
use serde::Deserialize;

/// Largest relative difference between the proportions of a [`Placement::Whole`] picture and the view, because methods
/// round sizes to multiples of 8 or 16.
const PROPORTIONS: f64 = 0.05;

/// How a picture lies on the input view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Placement {
    /// The picture shows the whole view and has its proportions, up to rounding.
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
    /// Its upper left corner.
    pub corner: DVec2,
    /// Its width and height.
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
    /// The word in adapters.
    pub fn word(self) -> &'static str {
        match self {
            Self::Whole => "whole",
            Self::Stretched => "stretched",
            Self::CentreCrop => "centre_crop",
        }
    }

    /// The part of a view of the size `view` that a picture of the size `picture` shows, both as width and height in
    /// pixels. None where the placement does not allow the picture's proportions.
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
