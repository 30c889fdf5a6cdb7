//! Pictures side by side, as in the paper's Figures 4 to 7: one row for each view; the truth first, then one column for
//! each submission.

use std::path::{Path, PathBuf};

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::{Progress, Report, SceneId};
use mateval_eval::metric::PictureKind;
use mateval_eval::protocol::{Protocol, Track};
use mateval_eval::shown::{SceneAlbedo, SceneLight, scene_albedo, scene_light};
use mateval_eval::truth::ViewTruth;
use mateval_files::work_folder::{check_free, make_folder};
use mateval_image::transfer::byte_from_unit;
use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb, png_io};

use crate::error::ReportError;

/// In novel views, pixels that the input view sees are darkened to this share of their sRGB values.
const OBSERVED_SHARE: f32 = 0.4;
/// The error that is drawn white: root mean square over the channels.
pub const WHITE_ERROR: f32 = 0.5;
/// Pixels between pictures, and their colour.
const GAP: usize = 4;
pub(crate) const GAP_COLOR: [u8; 3] = [255; 3];
/// Height of the colour scale below error maps, in pixels.
pub(crate) const SCALE_ROWS: usize = 12;

/// What strips show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// base_color, with errors of linear values.
    Albedo,
    /// Renders under a track of the protocol that has it, with errors of sRGB values. Not [`Track::Relit`], which has
    /// several lights.
    Light {
        track: Track,
        /// Samples per pixel in each of two halves.
        samples: u32,
    },
}

/// What strips are made from.
pub struct StripPlan<'a> {
    /// The dataset, with its ground truth.
    pub dataset: &'a Dataset,
    /// Folders of submissions, one column for each.
    pub submissions: &'a [&'a Path],
    /// The scenes to show; all if empty.
    pub scenes: &'a [SceneId],
    /// What to show, in a pair of files each.
    pub shown: &'a [Shown],
    pub out: &'a Path,
    /// Whether existing pictures are replaced.
    pub force: bool,
}

/// The row of a view: its masks, and the pictures of the truth and then of every submission.
pub(crate) struct StripRow {
    pub(crate) truth: ViewTruth,
    pub(crate) shown: Vec<Picture<SrgbRgb>>,
    /// The values that errors are computed from.
    compared: Vec<Picture<[f32; 3]>>,
}

impl StripPlan<'_> {
    /// What is shown of the scene: no light where the scene has a photo from elsewhere, whose light is not known, and
    /// nothing where it is captured, so that its true materials are not known either.
    pub(crate) fn shown_of(&self, scene: &SceneFile) -> impl Iterator<Item = Shown> {
        let (has_light, has_materials) = (scene.photo.is_none(), scene.source.kind.states_materials());
        self.shown.iter().copied().filter(move |shown| has_materials && (has_light || *shown == Shown::Albedo))
    }
}

impl Shown {
    /// The kind of picture that is shown, which file names contain.
    pub fn kind(self) -> PictureKind {
        match self {
            Self::Albedo => PictureKind::Albedo,
            Self::Light { track, .. } => track.row().picture,
        }
    }
}

/// Writes `<scene>-<kind>.png` and `<scene>-<kind>-error.png` for each scene and kind of picture. Returns their paths.
///
/// Rows are views in the dataset's order; columns are the truth, then the submissions in the plan's order. In novel
/// views, pixels that the input view sees are darkened. Invalid pixels are black. Error maps have no column for the
/// truth; their last row is the colour scale, from black for 0 on the left to white for [`WHITE_ERROR`] on the right.
pub fn write(plan: &StripPlan<'_>, progress: Progress<'_>) -> Result<Vec<PathBuf>, ReportError> {
    let chosen = plan.dataset.chosen_scenes(plan.scenes)?;
    if let Some(absence) = plan.dataset.absence().filter(|_| plan.scenes.is_empty()) {
        progress(Report::Message(&absence));
    }
    for scene in chosen.iter().filter(|scene| !scene.source.kind.states_materials()) {
        let message =
            format!("scene {} is captured: its true materials are not known, so it has no pictures", scene.id);
        progress(Report::Message(&message));
    }
    let paths = |scene: &SceneId, shown: Shown| {
        ["", "-error"].map(|what| plan.out.join(format!("{scene}-{}{what}.png", shown.kind())))
    };
    let jobs: Vec<(&SceneFile, Shown)> =
        chosen.iter().flat_map(|scene| plan.shown_of(scene).map(|shown| (*scene, shown))).collect();
    for (scene, shown) in &jobs {
        paths(&scene.id, *shown).iter().try_for_each(|path| check_free(path, plan.force, "--out"))?;
    }
    if jobs.len() < chosen.len() * plan.shown.len() {
        progress(Report::Message("scenes with a photo from elsewhere have no pictures of light, which is not known"));
    }
    make_folder(plan.out)?;
    let mut written = Vec::new();
    for (done, &(scene, shown)) in jobs.iter().enumerate() {
        progress(Report::step("pictures", done, jobs.len()));
        let rows = rows(plan, scene, shown, progress)?;
        let files = paths(&scene.id, shown);
        let strips: Vec<Vec<Picture<[u8; 3]>>> = rows.iter().map(strip).collect();
        png_io::write_rgb_bytes(&files[0], &grid(&strips))?;
        let mut errors: Vec<Vec<Picture<[u8; 3]>>> = rows.iter().map(errors).collect();
        if let Some(row) = errors.first() {
            errors.push(row.iter().map(|picture| scale(picture.width())).collect());
        }
        png_io::write_rgb_bytes(&files[1], &grid(&errors))?;
        written.extend(files);
    }
    Ok(written)
}

/// The rows of one scene.
pub(crate) fn rows(
    plan: &StripPlan<'_>,
    scene: &SceneFile,
    shown: Shown,
    progress: Progress<'_>,
) -> Result<Vec<StripRow>, ReportError> {
    match shown {
        Shown::Albedo => Ok(scene_albedo(plan.dataset, scene, plan.submissions)?.into_iter().map(albedo_row).collect()),
        Shown::Light { track: Track::Relit, .. } => Err(ReportError::RelitTrack),
        Shown::Light { track, samples } => {
            let mut protocol = Protocol::named(if track == Track::Fitted { "paper" } else { "mateval-3" })?;
            protocol.light.tracks = vec![track];
            protocol.light.samples.each_half = samples;
            let views = scene_light(plan.dataset, scene, plan.submissions, &protocol, None, progress)?;
            Ok(views.into_iter().map(light_row).collect())
        }
    }
}

fn albedo_row(view: SceneAlbedo) -> StripRow {
    let pictures: Vec<Picture<LinearRgb>> = std::iter::once(view.truth.albedo.clone()).chain(view.predicted).collect();
    StripRow {
        truth: view.truth,
        shown: pictures.iter().map(Picture::to_srgb).collect(),
        compared: pictures.iter().map(|picture| picture.map(|LinearRgb(rgb)| rgb)).collect(),
    }
}

fn light_row(view: SceneLight) -> StripRow {
    let shown: Vec<Picture<SrgbRgb>> = std::iter::once(view.reference).chain(view.predicted).collect();
    let compared = shown.iter().map(|picture| picture.map(|SrgbRgb(rgb)| rgb)).collect();
    StripRow { truth: view.truth, shown, compared }
}

/// The truth and the predictions of one view.
fn strip(row: &StripRow) -> Vec<Picture<[u8; 3]>> {
    row.shown.iter().map(|picture| darkened(&row.truth, picture)).collect()
}

fn darkened(truth: &ViewTruth, picture: &Picture<SrgbRgb>) -> Picture<[u8; 3]> {
    Picture::from_fn(picture.width(), picture.height(), |x, y| {
        let is_observed = truth.unobserved.as_ref().is_some_and(|mask| !mask.get(x, y));
        let share = match (truth.valid.get(x, y), is_observed) {
            (false, _) => 0.0,
            (true, true) => OBSERVED_SHARE,
            (true, false) => 1.0,
        };
        picture.get(x, y).0.map(|v| byte_from_unit(v * share))
    })
}

/// The error map of each submission.
pub(crate) fn errors(row: &StripRow) -> Vec<Picture<[u8; 3]>> {
    let Some((reference, predicted)) = row.compared.split_first() else { return Vec::new() };
    predicted.iter().map(|picture| error_map(picture, reference, &row.truth.valid)).collect()
}

/// The errors of a picture; invalid pixels are black.
pub(crate) fn error_map(
    prediction: &Picture<[f32; 3]>,
    reference: &Picture<[f32; 3]>,
    valid: &Mask,
) -> Picture<[u8; 3]> {
    Picture::from_fn(prediction.width(), prediction.height(), |x, y| match valid.get(x, y) {
        true => error_color(prediction.get(x, y), reference.get(x, y)),
        false => [0; 3],
    })
}

/// The colour of a pixel's error.
pub(crate) fn error_color(a: [f32; 3], b: [f32; 3]) -> [u8; 3] {
    let squares: f32 = (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum();
    glow((squares / 3.0).sqrt() / WHITE_ERROR)
}

/// Black, red, yellow, white for 0 to 1: brighter is worse, also in print and for colour-blind readers.
fn glow(share: f32) -> [u8; 3] {
    [0.0, 1.0, 2.0].map(|start| byte_from_unit(share.clamp(0.0, 1.0) * 3.0 - start))
}

/// The colours of errors from 0 to [`WHITE_ERROR`], left to right.
pub(crate) fn scale(width: usize) -> Picture<[u8; 3]> {
    Picture::from_fn(width, SCALE_ROWS, |x, _| glow((x as f32 + 0.5) / width as f32))
}

/// Pictures in rows and columns with gaps between them; those of a row have one height, those of a column one width.
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
    use mateval_image::Normal;

    use super::*;

    fn row() -> StripRow {
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
            normals: Picture::filled(4, 3, Normal::default()),
        };
        albedo_row(SceneAlbedo { truth, predicted })
    }

    #[test]
    fn observed_is_dark_and_invalid_black() {
        let shown = strip(&row());
        assert_eq!(shown.len(), 3);
        assert_eq!((shown[0].get(3, 1), shown[0].get(0, 1), shown[0].get(3, 0)), ([255; 3], [102; 3], [0; 3]));
    }

    #[test]
    fn no_error_is_black_and_half_is_white() {
        let errors = errors(&row());
        assert_eq!((errors[0].get(2, 2), errors[1].get(2, 2), errors[1].get(2, 0)), ([0; 3], [255; 3], [0; 3]));
        assert_eq!((glow(1.0 / 3.0), glow(2.0 / 3.0)), ([255, 0, 0], [255, 255, 0]));
    }

    #[test]
    fn grids_have_gaps_inside_only() {
        let grid = grid(&[strip(&row()), strip(&row())]);
        assert_eq!((grid.width(), grid.height()), (3 * 4 + 2 * GAP, 2 * 3 + GAP));
        assert_eq!((grid.get(4, 1), grid.get(4 + GAP + 3, 1)), (GAP_COLOR, [255; 3]));
    }
}
