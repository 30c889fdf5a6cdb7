//! Pictures side by side, as the paper's Figures 4 to 7: a row a view, the truth's column first, then one a submission.

use std::path::{Path, PathBuf};

use mateval_image::transfer::byte_from_unit;
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::open::Dataset;
use mateval_scene::{Progress, SceneError, SceneId};

use crate::error::EvalError;
use crate::score::{SceneAlbedo, chosen_scenes, scene_albedo};

/// What the input view shows is darkened to this share in the other views (of the sRGB value).
const OBSERVED_SHARE: f32 = 0.4;
/// The error that is white: root mean square over the channels, linear.
pub const WHITE_ERROR: f32 = 0.5;
/// Pixels between pictures, and their colour.
const GAP: usize = 4;
pub(crate) const GAP_COLOR: [u8; 3] = [255; 3];
/// Rows of the scale beneath error maps.
pub(crate) const SCALE_ROWS: usize = 12;

/// Writes `<scene>-albedo.png` and `<scene>-albedo-error.png` into the folder `out`. Gives their paths.
///
/// Views are rows in the dataset's order; columns are the truth, then the submissions in the plan's. In views other
/// than the input what it shows is darkened, and what is not valid is black. Error maps leave the truth's column out;
/// their last row is the scale, black 0 to white [`WHITE_ERROR`] from left to right.
pub fn write(
    dataset: &Dataset,
    submissions: &[&Path],
    scenes: &[SceneId],
    out: &Path,
    force: bool,
    progress: Progress<'_>,
) -> Result<Vec<PathBuf>, EvalError> {
    let chosen = chosen_scenes(dataset, scenes)?;
    let paths = |scene: &SceneId| ["albedo", "albedo-error"].map(|what| out.join(format!("{scene}-{what}.png")));
    let there = chosen.iter().flat_map(|scene| paths(&scene.id)).find(|path| path.exists() && !force);
    if let Some(path) = there {
        let what = format!("'{}' is already there; choose another --out, or add --force to replace it", path.display());
        return Err(EvalError::Invalid(what));
    }
    std::fs::create_dir_all(out).map_err(SceneError::io("make", out))?;
    let mut written = Vec::new();
    for (done, scene) in chosen.iter().enumerate() {
        progress("pictures", done, chosen.len());
        let views = scene_albedo(dataset, scene, submissions)?;
        let shown: Vec<Vec<Picture<[u8; 3]>>> = views.iter().map(shown).collect();
        let [albedo, error] = paths(&scene.id);
        png_io::write_rgb_bytes(&albedo, &grid(&shown))?;
        let mut errors: Vec<Vec<Picture<[u8; 3]>>> = views.iter().map(errors).collect();
        if let Some(row) = errors.first() {
            errors.push(row.iter().map(|picture| scale(picture.width())).collect());
        }
        png_io::write_rgb_bytes(&error, &grid(&errors))?;
        written.extend([albedo, error]);
    }
    Ok(written)
}

/// The truth and the predictions of one view.
fn shown(view: &SceneAlbedo) -> Vec<Picture<[u8; 3]>> {
    std::iter::once(&view.truth.albedo).chain(&view.predicted).map(|picture| darkened(view, picture)).collect()
}

fn darkened(view: &SceneAlbedo, picture: &Picture<LinearRgb>) -> Picture<[u8; 3]> {
    let encoded = picture.to_srgb();
    Picture::from_fn(picture.width(), picture.height(), |x, y| {
        let is_observed = view.truth.unobserved.as_ref().is_some_and(|mask| !mask.get(x, y));
        let share = match (view.truth.valid.get(x, y), is_observed) {
            (false, _) => 0.0,
            (true, true) => OBSERVED_SHARE,
            (true, false) => 1.0,
        };
        encoded.get(x, y).0.map(|v| byte_from_unit(v * share))
    })
}

fn errors(view: &SceneAlbedo) -> Vec<Picture<[u8; 3]>> {
    let error = |picture: &Picture<LinearRgb>| {
        Picture::from_fn(picture.width(), picture.height(), |x, y| {
            if !view.truth.valid.get(x, y) {
                return [0; 3];
            }
            error_color(picture.get(x, y), view.truth.albedo.get(x, y))
        })
    };
    view.predicted.iter().map(error).collect()
}

/// The colour of a pixel's error.
pub(crate) fn error_color(LinearRgb(a): LinearRgb, LinearRgb(b): LinearRgb) -> [u8; 3] {
    let squares: f32 = (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum();
    glow((squares / 3.0).sqrt() / WHITE_ERROR)
}

/// Black, red, yellow, white for 0 to 1: brighter is worse, in print and to the colour-blind too.
fn glow(share: f32) -> [u8; 3] {
    [0.0, 1.0, 2.0].map(|start| byte_from_unit(share.clamp(0.0, 1.0) * 3.0 - start))
}

/// The colours of errors from 0 to [`WHITE_ERROR`], left to right.
pub(crate) fn scale(width: usize) -> Picture<[u8; 3]> {
    Picture::from_fn(width, SCALE_ROWS, |x, _| glow((x as f32 + 0.5) / width as f32))
}

/// Rows of pictures with gaps between them; pictures of one row are of one height, of one column of one width.
pub(crate) fn grid(rows: &[Vec<Picture<[u8; 3]>>]) -> Picture<[u8; 3]> {
    let starts = |sizes: &mut dyn Iterator<Item = usize>| {
        let mut starts = vec![0];
        sizes.for_each(|size| starts.push(starts[starts.len() - 1] + size + GAP));
        starts
    };
    let lefts = starts(&mut rows.first().into_iter().flatten().map(Picture::width));
    let tops = starts(&mut rows.iter().map(|row| row.first().map_or(0, Picture::height)));
    let size = |starts: &[usize]| starts[starts.len() - 1].saturating_sub(GAP).max(1);
    let mut whole = Picture::filled(size(&lefts), size(&tops), GAP_COLOR);
    for (row, top) in rows.iter().zip(&tops) {
        for (picture, left) in row.iter().zip(&lefts) {
            for (at, pixel) in picture.pixels().iter().enumerate() {
                whole.set(left + at % picture.width(), top + at / picture.width(), *pixel);
            }
        }
    }
    whole
}

#[cfg(test)]
mod tests {
    use mateval_image::Mask;

    use super::*;
    use crate::truth::ViewTruth;

    fn view() -> SceneAlbedo {
        let truth = Picture::filled(4, 3, LinearRgb([1.0; 3]));
        let predicted = vec![truth.clone(), Picture::filled(4, 3, LinearRgb([0.5; 3]))];
        let unobserved = Some(Mask::from_fn(4, 3, |x, _| x == 3));
        let truth = ViewTruth {
            albedo: truth,
            roughness: Picture::filled(4, 3, 0.5),
            metallic: Picture::filled(4, 3, 0.0),
            valid: Mask::from_fn(4, 3, |_, y| y > 0),
            unobserved,
            specular: None,
            instances: Picture::filled(4, 3, 1),
        };
        SceneAlbedo { truth, predicted }
    }

    #[test]
    fn observed_is_dark_and_invalid_black() {
        let shown = shown(&view());
        assert_eq!(shown.len(), 3);
        assert_eq!((shown[0].get(3, 1), shown[0].get(0, 1), shown[0].get(3, 0)), ([255; 3], [102; 3], [0; 3]));
    }

    #[test]
    fn no_error_is_black_and_half_is_white() {
        let errors = errors(&view());
        assert_eq!((errors[0].get(2, 2), errors[1].get(2, 2), errors[1].get(2, 0)), ([0; 3], [255; 3], [0; 3]));
        assert_eq!((glow(1.0 / 3.0), glow(2.0 / 3.0)), ([255, 0, 0], [255, 255, 0]));
    }

    #[test]
    fn grids_have_gaps_inside_only() {
        let grid = grid(&[shown(&view()), shown(&view())]);
        assert_eq!((grid.width(), grid.height()), (3 * 4 + 2 * GAP, 2 * 3 + GAP));
        assert_eq!((grid.get(4, 1), grid.get(4 + GAP + 3, 1)), (GAP_COLOR, [255; 3]));
    }
}
