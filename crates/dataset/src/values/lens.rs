//! The lens of a photo: a pinhole with the radial and tangential distortion of Brown and Conrady, as OpenCV, COLMAP and
//! nerfstudio have it (`k1`, `k2`, `p1`, `p2`), and the pinhole to which such a photo is undistorted.
//!
//! A direction in front of the camera is written as (x, y): x to the right and y down, both divided by the depth.

use glam::{DMat2, DVec2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Intrinsics;

/// Focal lengths and principal point in pixels of the photo as its file holds it, and the distortion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// Number of columns of the photo.
    pub width: u32,
    /// Number of rows of the photo.
    pub height: u32,
    /// Focal length along rows, in pixels.
    pub fx: f64,
    /// Focal length along columns, in pixels.
    pub fy: f64,
    /// Column of the principal point, in pixels from the left edge.
    pub cx: f64,
    /// Row of the principal point, in pixels from the top edge.
    pub cy: f64,
    /// Radial distortion by the square of the radius.
    pub k1: f64,
    /// Radial distortion by its fourth power.
    pub k2: f64,
    /// Tangential distortion along columns.
    pub p1: f64,
    /// Tangential distortion along rows.
    pub p2: f64,
}

/// Steps of Newton's method, which converges in five where the distortion has an inverse.
const STEPS: usize = 30;
/// How near the direction that is found must come, as it is distorted again.
const NEAR: f64 = 1e-12;
/// Places on each edge of a picture by which its undistorted size is found.
const EDGE_PLACES: u32 = 64;
/// The most by which focal lengths are multiplied so that the whole picture lies in the photo.
const MOST_ZOOM: f64 = 4.0;

impl Lens {
    pub fn pinhole(k: &Intrinsics) -> Self {
        let Intrinsics { width, height, fx, fy, cx, cy } = *k;
        Self { width, height, fx, fy, cx, cy, k1: 0.0, k2: 0.0, p1: 0.0, p2: 0.0 }
    }

    pub fn is_distorted(&self) -> bool {
        [self.k1, self.k2, self.p1, self.p2] != [0.0; 4]
    }

    /// The place in the photo of the direction (x, y).
    pub fn place(&self, direction: DVec2) -> DVec2 {
        let seen = self.distorted(direction);
        DVec2::new(self.cx + self.fx * seen.x, self.cy + self.fy * seen.y)
    }

    /// The direction that the photo shows at `place`; absent where the distortion has no inverse.
    pub fn direction(&self, place: DVec2) -> Option<DVec2> {
        let wanted = DVec2::new((place.x - self.cx) / self.fx, (place.y - self.cy) / self.fy);
        let mut found = wanted;
        for _ in 0..STEPS {
            let off = self.distorted(found) - wanted;
            if off.length() < NEAR {
                return self.unfolds(found).then_some(found);
            }
            let slope = self.slope(found);
            if slope.determinant() <= 0.0 {
                return None;
            }
            found -= slope.inverse() * off;
        }
        None
    }

    fn distorted(&self, DVec2 { x, y }: DVec2) -> DVec2 {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * self.k2);
        DVec2::new(
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    /// The derivative of [`Self::distorted`]: its columns are those along x and along y.
    fn slope(&self, DVec2 { x, y }: DVec2) -> DMat2 {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * self.k2);
        let growth = 2.0 * (self.k1 + 2.0 * r2 * self.k2);
        let mixed = x * y * growth + 2.0 * (self.p1 * x + self.p2 * y);
        let along_x = radial + x * x * growth + 2.0 * self.p1 * y + 6.0 * self.p2 * x;
        let along_y = radial + y * y * growth + 6.0 * self.p1 * y + 2.0 * self.p2 * x;
        DMat2::from_cols(DVec2::new(along_x, mixed), DVec2::new(mixed, along_y))
    }

    /// Whether no direction between the axis and this one is shown twice: beyond a radius, a strong lens folds back.
    fn unfolds(&self, direction: DVec2) -> bool {
        (0..=8).all(|eighth| self.slope(direction * f64::from(eighth) / 8.0).determinant() > 0.0)
    }

    /// The pinhole of a picture of `width` times `height` pixels that shows the undistorted photo: it has the photo's
    /// focal lengths at that size, times the least factor of at least 1 with which the photo holds every pixel. Absent
    /// where no factor of at most 4 will do, or the distortion has no inverse over the picture.
    pub fn undistorted(&self, width: u32, height: u32) -> Option<Intrinsics> {
        let (x, y) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        let zoomed = |zoom: f64| Intrinsics {
            width,
            height,
            fx: self.fx * x * zoom,
            fy: self.fy * y * zoom,
            cx: self.cx * x,
            cy: self.cy * y,
        };
        if !self.is_distorted() || self.holds(&zoomed(1.0)) {
            return Some(zoomed(1.0));
        }
        let (mut least, mut most) = (1.0, MOST_ZOOM);
        if !self.holds(&zoomed(most)) {
            return None;
        }
        for _ in 0..50 {
            let middle = 0.5 * (least + most);
            if self.holds(&zoomed(middle)) { most = middle } else { least = middle }
        }
        Some(zoomed(most))
    }

    /// Whether the photo shows all that the edges of the pinhole's picture show.
    fn holds(&self, pinhole: &Intrinsics) -> bool {
        let (width, height) = (f64::from(pinhole.width), f64::from(pinhole.height));
        let shown = |place: DVec2| {
            let direction = pinhole.direction(place);
            let DVec2 { x, y } = self.place(direction);
            let inside = x >= 0.0 && y >= 0.0 && x <= f64::from(self.width) && y <= f64::from(self.height);
            inside && self.unfolds(direction)
        };
        (0..=EDGE_PLACES).all(|step| {
            let share = f64::from(step) / f64::from(EDGE_PLACES);
            let (x, y) = (share * width, share * height);
            [(x, 0.0), (x, height), (0.0, y), (width, y)].into_iter().all(|(x, y)| shown(DVec2::new(x, y)))
        })
    }
}

impl Intrinsics {
    /// The direction (x, y) through the point `pixel` of the picture.
    pub fn direction(&self, pixel: DVec2) -> DVec2 {
        DVec2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(k1: f64, k2: f64, p1: f64, p2: f64) -> Lens {
        Lens { width: 640, height: 480, fx: 500.0, fy: 510.0, cx: 322.0, cy: 238.0, k1, k2, p1, p2 }
    }

    /// By hand: r² = 0.25, radial = 1 - 0.05 + 0.00625 = 0.95625; x: 0.3·0.95625 + 2·0.001·0.12 + 0.002·(0.25 + 0.18);
    /// y: 0.4·0.95625 + 0.001·(0.25 + 0.32) + 2·0.002·0.12.
    #[test]
    fn a_place_is_that_computed_by_hand() {
        let place = lens(-0.2, 0.1, 0.001, 0.002).place(DVec2::new(0.3, 0.4));
        let expected = DVec2::new(322.0 + 500.0 * 0.287_975, 238.0 + 510.0 * 0.383_55);
        assert!((place - expected).length() < 1e-9, "{place} {expected}");
    }

    #[test]
    fn a_direction_is_the_inverse_of_its_place() {
        for lens in [lens(-0.2, 0.0, 0.0, 0.0), lens(0.15, 0.05, 0.001, -0.002), lens(0.0, 0.0, 0.0, 0.0)] {
            for (x, y) in [(0.0, 0.0), (3.5, 470.25), (639.0, 1.0), (322.0, 238.0), (500.0, 300.0)] {
                let place = DVec2::new(x, y);
                let back = lens.place(lens.direction(place).unwrap());
                assert!((back - place).length() < 1e-8, "{place} {back}");
            }
        }
    }

    /// With k1 = -1, the radius 1/√3 is shown at 2/(3√3) = 0.385, and nothing beyond.
    #[test]
    fn beyond_its_fold_a_lens_shows_no_direction() {
        let lens = lens(-1.0, 0.0, 0.0, 0.0);
        assert!(lens.direction(DVec2::new(lens.cx + 0.38 * lens.fx, lens.cy)).is_some());
        assert!(lens.direction(DVec2::new(lens.cx + 0.40 * lens.fx, lens.cy)).is_none());
        assert!(lens.undistorted(640, 480).is_some_and(|k| k.fx > lens.fx));
        assert!(Lens { k1: -100.0, ..lens }.undistorted(640, 480).is_none());
    }

    /// A barrel shows more than the pinhole of its focal length, which is kept; a pincushion less.
    #[test]
    fn the_undistorted_picture_lies_in_the_photo() {
        let plain = lens(0.0, 0.0, 0.0, 0.0).undistorted(320, 240).unwrap();
        assert_eq!((plain.fx, plain.fy, plain.cx, plain.cy), (250.0, 255.0, 161.0, 119.0));
        assert_eq!(lens(-0.2, 0.0, 0.0, 0.0).undistorted(320, 240), Some(plain));
        let pincushion = lens(0.2, 0.0, 0.0, 0.0);
        let zoomed = pincushion.undistorted(320, 240).unwrap();
        assert!(zoomed.fx > 1.05 * plain.fx && pincushion.holds(&zoomed));
        let wider = Intrinsics { fx: zoomed.fx * 0.999, fy: zoomed.fy * 0.999, ..zoomed };
        assert!(!pincushion.holds(&wider));
    }
}
