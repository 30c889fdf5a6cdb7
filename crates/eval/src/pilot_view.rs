//! A view as the pilot renders it: with square pixels of several pixels a side, whose radiance is the mean of theirs.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_scene::{Camera, Intrinsics};

use crate::light_rules::NoiseRules;
use crate::lit_scene::LitScene;
use crate::noise_blocks::noise_blocks;
use crate::relit::LightingName;

/// A view with large pixels.
pub(crate) struct PilotView {
    pub(crate) camera: Camera,
    /// Pixels all of whose parts are valid.
    pub(crate) valid: Mask,
    pub(crate) blocks: Picture<u32>,
    /// For each prediction of a batch, the ratio of base colours.
    pub(crate) ratios: Vec<Picture<LinearRgb>>,
    /// The truth's halves, exposed, by lighting.
    pub(crate) truths: BTreeMap<Option<LightingName>, [Picture<LinearRgb>; 2]>,
}

/// All views of a scene, with the ratios of the predictions of a batch.
pub(crate) fn pilot_views(rules: &NoiseRules, lit: &LitScene<'_>, batch: &[usize]) -> Vec<PilotView> {
    let side = rules.pilot_pixels as usize;
    let cameras: Vec<Camera> =
        lit.cameras().iter().map(|camera| with_large_pixels(camera, rules.pilot_pixels)).collect();
    let of_blocks = NoiseRules { block_pixels: (rules.block_pixels / rules.pilot_pixels).max(1), ..rules.clone() };
    let blocks = noise_blocks(&of_blocks, &cameras);
    let view = |(at, (camera, blocks)): (usize, (Camera, Picture<u32>))| {
        let (width, height) = (blocks.width(), blocks.height());
        let valid = &lit.truths[at].valid;
        // A view of one column or row has no whole square.
        let last = |size: usize, at: usize| at.min(size - 1);
        let parts = |x: usize, y: usize| (0..side * side).map(move |k| (x * side + k % side, y * side + k / side));
        let halves = |light: &crate::truth::TrueLight| light.halves().map(|half| enlarged_pixels(&half, side));
        PilotView {
            camera,
            valid: Mask::from_fn(width, height, |x, y| {
                parts(x, y).all(|(x, y)| valid.get(last(valid.width(), x), last(valid.height(), y)))
            }),
            blocks,
            ratios: batch.iter().map(|&index| enlarged_pixels(&lit.ratio(index, at), side)).collect(),
            truths: lit.lights.iter().map(|(name, views)| (*name, halves(&views[at]))).collect(),
        }
    };
    cameras.into_iter().zip(blocks).enumerate().map(view).collect()
}

/// The picture with each square of `side` pixels averaged to one. Pixels that fill no square are
/// left out, unless the picture is smaller than a square.
pub(crate) fn enlarged_pixels(picture: &Picture<LinearRgb>, side: usize) -> Picture<LinearRgb> {
    let share = 1.0 / (side * side) as f32;
    Picture::from_fn((picture.width() / side).max(1), (picture.height() / side).max(1), |x, y| {
        let mut sum = [0.0; 3];
        for k in 0..side * side {
            let (x, y) = (x * side + k % side, y * side + k / side);
            let pixel = picture.get(x.min(picture.width() - 1), y.min(picture.height() - 1)).0;
            (0..3).for_each(|c| sum[c] += share * pixel[c]);
        }
        LinearRgb(sum)
    })
}

/// The camera of [`enlarged_pixels`].
fn with_large_pixels(camera: &Camera, side: u32) -> Camera {
    let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
    let [fx, fy, cx, cy] = [fx, fy, cx, cy].map(|v| v / f64::from(side));
    let intrinsics = Intrinsics { width: (width / side).max(1), height: (height / side).max(1), fx, fy, cx, cy };
    Camera { intrinsics, ..*camera }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec2, DVec3};

    use super::*;

    /// The corner of a large pixel is that of its first part.
    #[test]
    fn large_pixels_look_where_their_parts_do() {
        let camera = Camera::from_rotation(DMat3::IDENTITY, DVec3::ZERO, Intrinsics::from_fov_x(7, 5, 1.0));
        let large = with_large_pixels(&camera, 2);
        assert_eq!((large.intrinsics.width, large.intrinsics.height), (3, 2));
        for (x, y) in [(0.0, 0.0), (1.0, 1.0), (3.0, 2.0), (2.5, 0.5)] {
            let [small, large] =
                [(camera, 2.0), (large, 1.0)].map(|(camera, side)| camera.direction(DVec2::new(side * x, side * y)));
            assert!((small - large).length() < 1e-12, "{small} {large}");
        }
    }

    #[test]
    fn squares_are_averaged() {
        let picture = Picture::from_fn(5, 3, |x, y| LinearRgb([x as f32, y as f32, 1.0]));
        let large = enlarged_pixels(&picture, 2);
        assert_eq!((large.width(), large.height()), (2, 1));
        assert_eq!((large.get(0, 0).0, large.get(1, 0).0), ([0.5, 0.5, 1.0], [2.5, 0.5, 1.0]));
    }
}
