//! Pictures of one instance: the truth, the prediction, and where they differ.

use mateval_image::transfer::byte_from_unit;
use mateval_image::{LinearRgb, Picture};

use super::model::patch_error;
use super::patch::Patch;
use crate::strips::{GAP_COLOR, SCALE_ROWS, error_color, grid, scale};
use mateval_eval::shown_scene::SceneAlbedo;

/// Width of the margin around the instance, in pixels.
const MARGIN: usize = 8;
/// Pixels of other instances are darkened to this share of their sRGB values.
const OTHERS_SHARE: f32 = 0.4;
/// The width or height, in pixels, that crops are enlarged towards by a whole factor.
const TARGET_SIZE: usize = 400;

/// Number of the view in which the instance has the largest sum of squared errors.
pub(super) fn worst_view(patches: &[Patch]) -> usize {
    let error = |patch: &Patch| patch_error(&patch.truth, &patch.predicted);
    patches.iter().max_by(|a, b| error(a).total_cmp(&error(b)).then(b.view.cmp(&a.view))).map_or(0, |patch| patch.view)
}

/// Truth, prediction and error of that view side by side, with the colour scale of errors, from 0 to
/// [`crate::strips::WHITE_ERROR`], below the error. Other instances are dark and show no error.
pub(super) fn crop(views: &[SceneAlbedo], patches: &[Patch]) -> Picture<[u8; 3]> {
    let number = worst_view(patches);
    let patch = patches.iter().find(|patch| patch.view == number).expect("the worst view is one of the patches'");
    let view = &views[number];
    let (truth, predicted) = (&view.truth.albedo, &view.predicted[0]);
    let area = Area::around(patch, truth);
    let shown = |picture: &Picture<LinearRgb>| {
        let encoded = picture.to_srgb();
        area.picture(|x, y| {
            let share = match (view.truth.valid.get(x, y), area.is_instance(patch, x, y)) {
                (_, true) => 1.0,
                (true, false) => OTHERS_SHARE,
                (false, false) => 0.0,
            };
            encoded.get(x, y).0.map(|v| byte_from_unit(v * share))
        })
    };
    let error = area.picture(|x, y| match area.is_instance(patch, x, y) {
        true => error_color(predicted.get(x, y).0, truth.get(x, y).0),
        false => [0; 3],
    });
    let below = Picture::filled(error.width(), SCALE_ROWS, GAP_COLOR);
    let scale = scale(error.width());
    grid(&[vec![shown(truth), shown(predicted), error], vec![below.clone(), below, scale]])
}

/// The part of a picture that is shown, and how much it is enlarged.
struct Area {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
    factor: usize,
}

impl Area {
    fn around(patch: &Patch, picture: &Picture<LinearRgb>) -> Self {
        let [left, top] = patch.corner.map(|v| v.saturating_sub(MARGIN));
        let right = (patch.corner[0] + patch.size[0] + MARGIN).min(picture.width());
        let bottom = (patch.corner[1] + patch.size[1] + MARGIN).min(picture.height());
        let (width, height) = (right - left, bottom - top);
        Self { left, top, width, height, factor: (TARGET_SIZE / width.max(height)).max(1) }
    }

    /// `color` of the picture's pixels, each enlarged to a square.
    fn picture(&self, color: impl Fn(usize, usize) -> [u8; 3]) -> Picture<[u8; 3]> {
        Picture::from_fn(self.width * self.factor, self.height * self.factor, |x, y| {
            color(self.left + x / self.factor, self.top + y / self.factor)
        })
    }

    fn is_instance(&self, patch: &Patch, x: usize, y: usize) -> bool {
        patch.at(x as isize - patch.corner[0] as isize, y as isize - patch.corner[1] as isize).is_some()
    }
}
