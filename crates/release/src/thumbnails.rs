//! Small pictures of each scene's input view. Only files outside of `ground_truth` are read.

use std::path::Path;

use mateval_image::jpeg_io::jpeg_bytes;
use mateval_image::store::write_whole;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::INPUT;
use mateval_scene::open::Dataset;
use mateval_scene::{SceneError, SceneId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReleaseError;

/// The folder of the pictures in the report's folder.
pub(crate) const PICTURES: &str = "pictures";

/// The most pixels of a row.
const MOST_WIDTH: usize = 240;

/// The quality of JPEG: the pictures are looked at only.
const QUALITY: u8 = 85;

/// A small picture of a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Thumbnail {
    /// Its file, relative to the report's folder.
    pub file: String,
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Writes the picture of a scene below `out`; none where the input view has not been rendered.
pub(crate) fn write(dataset: &Dataset, scene: &SceneFile, out: &Path) -> Result<Option<Thumbnail>, ReleaseError> {
    let Some(view) = scene.view(INPUT) else { return Ok(None) };
    let path = dataset.folder(&scene.id).view(&view.id).join("rgb.png");
    if !path.is_file() {
        return Ok(None);
    }
    let small = reduced(&png_io::read_srgb(&path)?.to_linear());
    let bytes = small.map(|LinearRgb(rgb)| rgb.map(|v| byte_from_unit(srgb_from_linear(v))));
    let jpeg = jpeg_bytes(&bytes, QUALITY).expect("a picture of 1 to 240 columns has a JPEG");
    let file = file(&scene.id);
    let place = out.join(&file);
    let folder = place.parent().unwrap_or(out);
    std::fs::create_dir_all(folder).map_err(SceneError::io("make", folder))?;
    write_whole(&place, &jpeg)?;
    Ok(Some(Thumbnail { file, width: small.width(), height: small.height() }))
}

fn file(scene: &SceneId) -> String {
    format!("{PICTURES}/{scene}.jpg")
}

/// The means of square blocks of pixels, of at most [`MOST_WIDTH`] blocks in a row. The last column and row may be cut.
fn reduced(picture: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    let side = picture.width().div_ceil(MOST_WIDTH).min(picture.height()).max(1);
    let mean = |x: usize, y: usize| {
        let pixels = (0..side * side).map(|at| picture.get(side * x + at % side, side * y + at / side).0);
        let sums = pixels.fold([0.0f64; 3], |sum, rgb| [0, 1, 2].map(|c| sum[c] + f64::from(rgb[c])));
        LinearRgb(sums.map(|sum| (sum / (side * side) as f64) as f32))
    };
    Picture::from_fn(picture.width() / side, picture.height() / side, mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_averaged() {
        let picture = Picture::from_fn(481, 7, |x, _| LinearRgb([(x % 3) as f32; 3]));
        let small = reduced(&picture);
        assert_eq!((small.width(), small.height()), (160, 2));
        assert!(small.pixels().iter().all(|pixel| *pixel == LinearRgb([1.0; 3])));
        let tiny = Picture::filled(3, 2, LinearRgb([0.5; 3]));
        assert_eq!(reduced(&tiny), tiny);
    }
}
