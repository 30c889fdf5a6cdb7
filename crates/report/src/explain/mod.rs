//! Where a submission's albedo errs in one scene, and how.
//!
//! In: a result, the dataset and the submission that it was made from. Out: an [`ExplainFile`], and pictures of the
//! worst instances.
//!
//! Between: all three are checked for belonging together, `kinds` splits the pictures by instance and the error of each
//! instance by kind, `scores` computes scores after scaling alone and lists the worst instances under each light, and
//! [`text`] prints the explanation.

pub mod file;
mod kinds;
mod scores;
pub mod text;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::Instance;
use mateval_dataset::open::Dataset;
use mateval_dataset::{Finding, Progress, Report, SceneId, ViewId};
use mateval_eval::metric::{Metric, PictureKind};
use mateval_eval::protocol::SCORER_VERSION;
use mateval_eval::result::key::ResultKey;
use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_eval::shown::{SceneAlbedo, scene_albedo};
use mateval_eval::truth::scored_views;
use mateval_files::whole::write_whole;
use mateval_files::work_folder::{check_free, make_folder};
use mateval_image::transfer::byte_from_unit;
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_metrics::Psnr;
use mateval_submission::files::{HashedSubmission, hashed_submission};
use rayon::prelude::*;

use self::file::{AlignedBy, EXPLAIN_FORMAT, ExplainFile, InstanceExplanation, ViewShift};
use self::kinds::{Explained, Patch, Shift, explained, patch_error, patches};
use self::scores::WORST;
use crate::error::{Mismatch, ReportError, SubmissionVersion};
use crate::strips::{GAP_COLOR, SCALE_ROWS, error_color, grid, scale};

/// The page that links the pictures.
const PAGE: &str = "explain.md";
/// Width of the margin around the instance, in pixels.
const MARGIN: usize = 8;
/// Pixels of other instances are darkened to this share of their sRGB values.
const OTHERS_SHARE: f32 = 0.4;
/// The width or height, in pixels, that crops are enlarged towards by a whole factor.
const TARGET_SIZE: usize = 400;

/// What to explain: one scene of one result, with the dataset and the submission that the result was made from.
pub struct ExplainPlan<'a> {
    pub result: &'a ResultFile,
    /// The protocol whose scores are explained.
    pub protocol: &'a str,
    /// The dataset that the result was scored on.
    pub dataset: &'a Dataset,
    /// Folder of the submission that was scored.
    pub submission: &'a Path,
    pub scene: &'a SceneId,
    /// Name and version of the tool, for the file.
    pub tool: String,
}

impl<'a> ExplainPlan<'a> {
    /// The result's scores under the plan's protocol.
    fn scores(&self) -> Result<&'a ProtocolResult, ReportError> {
        ReportError::refuse(Mismatch::of_result(self.result, self.protocol).into_iter().collect())?;
        Ok(&self.result.protocols[self.protocol])
    }

    /// The findings of the result that concern the scene.
    fn findings(&self) -> Vec<Finding> {
        let folder = format!("scenes/{}/", self.scene);
        self.result.findings.iter().filter(|finding| finding.file.starts_with(&folder)).cloned().collect()
    }
}

/// An explanation, and what is needed to draw its pictures.
pub struct Explanation {
    pub file: ExplainFile,
    views: Vec<SceneAlbedo>,
    /// By index of the instance.
    patches: BTreeMap<u16, Vec<Patch>>,
    /// Indices of the worst instances, worst first.
    worst: Vec<u16>,
}

/// Explains the error of the scene's albedo. Fails if result, dataset and submission do not belong together.
pub fn explain(plan: &ExplainPlan<'_>, progress: Progress<'_>) -> Result<Explanation, ReportError> {
    let scores = check(plan)?;
    let scene = plan.dataset.scene(plan.scene)?;
    progress(Report::step("pictures", 0, 2));
    // Wide views are scored apart.
    let ids = scored_views(plan.dataset, scene)?.into_iter().map(|view| view.id.clone());
    let shown = scene_albedo(plan.dataset, scene, &[plan.submission])?;
    let (ids, views): (Vec<ViewId>, Vec<_>) = ids.zip(shown).filter(|(id, _)| !id.is_wide()).unzip();
    progress(Report::step("kinds of error", 1, 2));
    let patches = patches(&views);
    let found: Vec<(u16, Explained)> =
        patches.par_iter().map(|(index, patches)| (*index, explained(patches))).collect();
    let whole = Explained::sum(found.iter().map(|(_, explained)| explained));
    // The instance with the largest share first.
    let explanation = |(index, found): &(u16, Explained)| {
        let instance = scene.instances.iter().find(|instance| instance.index.0.get() == *index)?;
        Some((*index, instance_explanation(&ids, instance, found, &whole)))
    };
    let mut instances: Vec<(u16, InstanceExplanation)> = found.iter().filter_map(explanation).collect();
    instances.sort_by(|(_, a), (_, b)| b.share.total_cmp(&a.share).then_with(|| a.instance.cmp(&b.instance)));
    let worst = instances.iter().filter(|(_, i)| i.mse > 0.0).take(WORST).map(|(index, _)| *index).collect();
    let named = |source| ReportError::Metric { what: format!("scene '{}'", scene.id), source };
    let file = ExplainFile {
        format: EXPLAIN_FORMAT.to_owned(),
        tool: plan.tool.clone(),
        method: plan.result.method.clone(),
        submission_sha256: plan.result.submission.sha256.clone(),
        dataset_manifest_sha256: plan.result.dataset.manifest_sha256.clone(),
        protocol: plan.protocol.to_owned(),
        fingerprint: scores.fingerprint.clone(),
        scene: plan.scene.clone(),
        views: ids,
        pixels: whole.pixels,
        unobserved_pixels: whole.unobserved_pixels,
        mse: whole.mse(),
        psnr: Psnr::from_mse(whole.mse()).map_err(named)?.db,
        kinds: whole.kinds(),
        instances: instances.into_iter().map(|(_, instance)| instance).collect(),
        alignments: scores::alignments(plan.scene, &scores.protocol, &views)?,
        light: scores::worst_under_lights(scores, plan.scene),
        findings: plan.findings(),
    };
    check_scores(scores, &file)?;
    progress(Report::step("kinds of error", 2, 2));
    Ok(Explanation { file, views, patches, worst })
}

fn instance_explanation(
    views: &[ViewId],
    instance: &Instance,
    found: &Explained,
    whole: &Explained,
) -> InstanceExplanation {
    let shift = |shift: &Shift| ViewShift { view: views[shift.view].clone(), pixels: shift.pixels };
    InstanceExplanation {
        instance: instance.id.clone(),
        category: instance.listed_category().map(str::to_owned),
        super_category: instance.listed_super_category().map(str::to_owned),
        pixels: found.pixels,
        mse: found.mse(),
        share: if whole.squared_error > 0.0 { found.squared_error / whole.squared_error } else { 0.0 },
        kinds: found.kinds(),
        scale: found.scale,
        channel_scales: found.channel_scales,
        shifts: found.shifts.iter().map(shift).collect(),
        blur_sigma_pixels: found.blur_sigma_pixels,
    }
}

impl Explanation {
    /// Writes a PNG for each of the worst instances and `explain.md` into the folder `out`. Returns their paths.
    pub fn write(&self, out: &Path, force: bool) -> Result<Vec<PathBuf>, ReportError> {
        let names: Vec<String> = self.file.instances[..self.worst.len()]
            .iter()
            .enumerate()
            .map(|(at, instance)| format!("{}-{:02}-{}.png", self.file.scene, at + 1, instance.instance))
            .collect();
        let page = out.join(PAGE);
        let paths: Vec<PathBuf> = names.iter().map(|name| out.join(name)).chain([page.clone()]).collect();
        paths.iter().try_for_each(|path| check_free(path, force, "--out"))?;
        make_folder(out)?;
        for (index, path) in self.worst.iter().zip(&paths) {
            png_io::write_rgb_bytes(path, &crop(&self.views, &self.patches[index]))?;
        }
        let crops: Vec<text::Crop> = names
            .iter()
            .zip(&self.worst)
            .map(|(name, index)| {
                let view = worst_view(&self.patches[index]);
                text::Crop { file: name.clone(), view: self.file.views[view].clone() }
            })
            .collect();
        write_whole(&page, text::markdown(&self.file, &crops).as_bytes())?;
        Ok(paths)
    }
}

/// Fails if the folder `out` already holds an explanation that may not be overwritten. Pictures, whose names are not
/// known yet, are checked when they are written.
pub fn check_out(out: &Path, force: bool) -> Result<(), ReportError> {
    Ok(check_free(&out.join(PAGE), force, "--out")?)
}

/// The scores to explain. Fails with every reason for which the three do not belong together.
fn check<'a>(plan: &ExplainPlan<'a>) -> Result<&'a ProtocolResult, ReportError> {
    let (result, dataset) = (plan.result, plan.dataset);
    let scores = plan.scores()?;
    let mut mismatches = Vec::new();
    if scores.protocol.scorer_version != SCORER_VERSION {
        mismatches.push(Mismatch::Scorer { found: scores.protocol.scorer_version });
    }
    mismatches.extend(Mismatch::of_dataset(result, dataset));
    if !result.dataset.scenes.contains(plan.scene) {
        let scored = result.dataset.scenes.clone();
        mismatches.push(Mismatch::SceneNotScored { scene: plan.scene.clone(), scored });
    }
    if mismatches.is_empty() {
        mismatches.extend(other_submission(plan)?);
    }
    ReportError::refuse(mismatches).map(|()| scores)
}

/// A mismatch if the submission does not have the hash that the result states.
fn other_submission(plan: &ExplainPlan<'_>) -> Result<Option<Mismatch>, ReportError> {
    let result = plan.result;
    let HashedSubmission { method, sha256, maps } =
        hashed_submission(plan.submission, plan.dataset, &result.dataset.scenes)?;
    let expected = SubmissionVersion { method: result.method.clone(), sha256: result.submission.sha256.clone() };
    Ok((sha256 != expected.sha256).then(|| Mismatch::Submission {
        expected,
        path: plan.submission.to_owned(),
        found: SubmissionVersion { method, sha256 },
        maps,
    }))
}

/// Fails if scores of the pictures made here differ from the result's: the explanation would be of something else.
fn check_scores(scores: &ProtocolResult, file: &ExplainFile) -> Result<(), ReportError> {
    let of_scene = scores.scenes.get(&file.scene);
    let pictures = [(AlignedBy::None, PictureKind::Albedo), (AlignedBy::PictureAndChannel, PictureKind::AlbedoAligned)];
    let mut mismatches = Vec::new();
    for alignment in &file.alignments {
        let Some((_, picture)) = pictures.iter().find(|(scales, _)| *scales == alignment.scales) else { continue };
        let key = ResultKey::whole(*picture, alignment.views, Metric::Mse);
        let expected = of_scene.and_then(|keys| keys.get(&key)).copied();
        if expected.is_none_or(|expected| (expected - alignment.mse).abs() > 1e-9 * expected.max(1e-12)) {
            mismatches.push(Mismatch::Score { key, scene: file.scene.clone(), expected, found: alignment.mse });
        }
    }
    ReportError::refuse(mismatches)
}

/// Number of the view in which the instance has the largest sum of squared errors.
fn worst_view(patches: &[Patch]) -> usize {
    let error = |patch: &Patch| patch_error(&patch.truth, &patch.predicted);
    patches.iter().max_by(|a, b| error(a).total_cmp(&error(b)).then(b.view.cmp(&a.view))).map_or(0, |patch| patch.view)
}

/// Truth, prediction and error of that view side by side, with the colour scale of errors, from 0 to
/// [`crate::strips::WHITE_ERROR`], below the error. Other instances are dark and show no error.
fn crop(views: &[SceneAlbedo], patches: &[Patch]) -> Picture<[u8; 3]> {
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

#[cfg(test)]
mod tests {
    //! Planted errors of each kind are recognised as that kind.

    use mateval_dataset::InstanceId;
    use mateval_eval::protocol::Protocol;
    use mateval_eval::result::InstancePixelErrors;
    use mateval_eval::result::key::Views;

    use super::file::KindShares;
    use super::kinds::blurred;
    use super::scores::worst_under_lights;
    use super::*;

    type Pixel = [f64; 3];

    /// White noise from 0.3 to 0.7, three fourths of it shared by all channels, computed from the position with
    /// integers alone.
    fn texture(x: i64, y: i64) -> Pixel {
        let noise = |channel: i64| {
            let mut word =
                (x.wrapping_mul(0x9E37_79B9) ^ y.wrapping_mul(0x85EB_CA6B) ^ channel.wrapping_mul(0xC2B2_AE35)) as u64;
            for _ in 0..3 {
                word = (word ^ (word >> 15)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
            }
            (word >> 40) as f64 / (1 << 24) as f64
        };
        [1, 2, 3].map(|channel| 0.3 + 0.3 * noise(0) + 0.1 * noise(channel))
    }

    /// Two views of a disc, each of another part of the texture; `prediction` maps a position and the truth there to a
    /// pixel.
    fn discs(prediction: impl Fn(i64, i64, Pixel) -> Pixel) -> Vec<Patch> {
        [0, 1]
            .map(|view| {
                let offset = 1000 * view as i64;
                let inside = |x: i64, y: i64| (x - 40) * (x - 40) + (y - 30) * (y - 30) < 28 * 28;
                let places: Vec<[i64; 2]> =
                    (0..60).flat_map(|y| (0..80).map(move |x| [x, y])).filter(|[x, y]| inside(*x, *y)).collect();
                let truth: Vec<Pixel> = places.iter().map(|[x, y]| texture(x + offset, *y)).collect();
                let predicted = places.iter().zip(&truth).map(|([x, y], t)| prediction(*x + offset, *y, *t)).collect();
                let (places, observed) =
                    (places.iter().map(|place| place.map(|v| v as usize)).collect(), observed_all(&truth));
                Patch::new(view, places, truth, predicted, observed)
            })
            .into()
    }

    fn observed_all(truth: &[Pixel]) -> Vec<bool> {
        vec![true; truth.len()]
    }

    fn list(kinds: &KindShares) -> [f64; 7] {
        [kinds.unobserved, kinds.scale, kinds.chroma, kinds.shading, kinds.misplacement, kinds.detail, kinds.rest]
    }

    /// Checks that the shares add up, that none is below 0, and that the kind at place `kind` has more than `least`.
    fn check(found: &Explained, kind: usize, least: f64) {
        let shares = list(&found.kinds().unwrap());
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{shares:?}");
        assert!(shares.iter().all(|share| *share > -1e-12), "{shares:?}");
        assert!(shares[kind] > least, "{shares:?}");
    }

    #[test]
    fn a_planted_scale_is_scale() {
        let found = explained(&discs(|_, _, t| t.map(|v| 0.6 * v)));
        check(&found, 1, 0.999_999);
        assert!((found.scale - 1.0 / 0.6).abs() < 1e-12);
    }

    #[test]
    fn a_planted_tint_is_chroma() {
        let tint = [1.25, 0.95, 0.8];
        let found = explained(&discs(|_, _, t| std::array::from_fn(|c| tint[c] * t[c])));
        check(&found, 2, 0.9);
        for (found_scale, tint) in found.channel_scales.iter().zip(tint) {
            assert!((found.scale * found_scale * tint - 1.0).abs() < 1e-12);
        }
    }

    /// Brighter to the right and down, as from a window.
    #[test]
    fn planted_shading_is_shading() {
        let found = explained(&discs(|x, y, t| {
            let light = 0.5 + 0.8 * ((x % 1000) as f64 / 80.0) + 0.3 * (y as f64 / 60.0).powi(3);
            t.map(|v| v * light)
        }));
        check(&found, 3, 0.9);
    }

    /// The prediction lies 3 pixels too far right and 2 too high.
    #[test]
    fn a_planted_shift_is_misplacement() {
        let found = explained(&discs(|x, y, _| texture(x - 3, y + 2)));
        check(&found, 4, 0.8);
        assert_eq!(found.shifts.iter().map(|shift| shift.pixels).collect::<Vec<_>>(), [[-3, 2]; 2]);
    }

    #[test]
    fn planted_blur_is_detail() {
        for sigma in [1.0, 2.0, 4.0] {
            let patches = discs(|_, _, t| t).into_iter().map(|patch| {
                let predicted = blurred(&patch, sigma);
                Patch::new(patch.view, patch.places, patch.truth, predicted, patch.observed)
            });
            let found = explained(&patches.collect::<Vec<_>>());
            check(&found, 5, 0.95);
            assert_eq!(found.blur_sigma_pixels, Some(sigma));
        }
    }

    /// The twin of them all: detail of another texture is of no known kind.
    #[test]
    fn planted_noise_is_rest() {
        let found = explained(&discs(|x, y, t| {
            let other = texture(x + 500_000, y);
            std::array::from_fn(|c| t[c] + other[c] - 0.5)
        }));
        check(&found, 6, 0.75);
    }

    /// A disc whose upper part the photo does not show: an error there is of no other kind, and does not change the
    /// kinds of the errors in the lower part.
    #[test]
    fn errors_of_hidden_surfaces_stay_apart() {
        let hidden = |mut patches: Vec<Patch>| {
            for patch in &mut patches {
                patch.observed = patch.places.iter().map(|[_, y]| *y >= 30).collect();
            }
            patches
        };
        let flat_above = explained(&hidden(discs(|_, y, t| if y < 30 { [0.5; 3] } else { t })));
        check(&flat_above, 0, 0.999);
        let both = explained(&hidden(discs(|_, y, t| if y < 30 { [0.5; 3] } else { t.map(|v| 0.6 * v) })));
        let shares = list(&both.kinds().unwrap());
        let below = 1.0 - shares[0];
        assert!((0.1..0.9).contains(&below) && shares[1] > 0.999 * below, "{shares:?}");
        assert_eq!(both.unobserved_pixels, flat_above.unobserved_pixels);
        assert!((0.4..0.6).contains(&(both.unobserved_pixels as f64 / both.pixels as f64)));
    }

    #[test]
    fn flat_predictions_do_not_improve_by_moving() {
        let found = explained(&discs(|_, _, _| [0.5; 3]));
        check(&found, 5, 0.8);
        assert!(found.shifts.is_empty());
    }

    #[test]
    fn the_truth_has_no_kinds() {
        let found = explained(&discs(|_, _, t| t));
        assert_eq!((found.kinds(), found.mse()), (None, 0.0));
    }

    /// Patches of one pixel, of one row and of black pixels do not fail, and their shares add up.
    #[test]
    fn degenerate_patches() {
        let row = |length: usize, predicted: Pixel| {
            let places: Vec<[usize; 2]> = (0..length).map(|x| [x, 7]).collect();
            let truth: Vec<Pixel> = places.iter().map(|[x, y]| texture(*x as i64, *y as i64)).collect();
            let observed = observed_all(&truth);
            Patch::new(0, places, truth, vec![predicted; length], observed)
        };
        for (length, predicted) in [(1, [0.2; 3]), (100, [0.2; 3]), (100, [0.0; 3]), (100, [0.2, 0.0, 0.0])] {
            let shares = list(&explained(&[row(length, predicted)]).kinds().unwrap());
            assert!(
                (shares.iter().sum::<f64>() - 1.0).abs() < 1e-9 && shares.iter().all(|v| *v > -1e-12),
                "{shares:?}"
            );
        }
    }

    /// Two instances as one scene: the parts of the sum are the sums of the parts.
    #[test]
    fn sums_of_instances_add_up() {
        let all = [explained(&discs(|_, _, t| t.map(|v| 0.6 * v))), explained(&discs(|x, y, _| texture(x - 3, y + 2)))];
        let whole = Explained::sum(all.iter());
        let shares = list(&whole.kinds().unwrap());
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        let scale = all.iter().map(|one| one.squared_error * one.kinds().unwrap().scale).sum::<f64>();
        assert!((shares[1] * whole.squared_error - scale).abs() < 1e-9 * scale);
    }

    fn errors(instance: &str, views: Views, pixels: usize, mse: f64) -> InstancePixelErrors {
        InstancePixelErrors {
            scene: SceneId::new("s").unwrap(),
            instance: InstanceId::new(instance).unwrap(),
            category: None,
            super_category: None,
            picture: PictureKind::RgbTrue,
            views,
            pixels,
            mse,
        }
    }

    /// 10 * 0.2 + 30 * 0.2 = 8 against 100 * 0.02 = 2; unobserved pixels belong to the novel views and are not counted
    /// twice.
    #[test]
    fn lights_worst_instances_by_share() {
        let instances = vec![
            errors("a", Views::Input, 10, 0.2),
            errors("a", Views::Novel, 30, 0.2),
            errors("a", Views::Unobserved, 30, 9.0),
            errors("b", Views::Input, 100, 0.02),
        ];
        let scores = ProtocolResult {
            protocol: Protocol::named("mateval-3").unwrap(),
            fingerprint: String::new(),
            summary: BTreeMap::new(),
            scenes: BTreeMap::new(),
            summary_noise: BTreeMap::new(),
            noise: BTreeMap::new(),
            fits: BTreeMap::new(),
            pictures: Vec::new(),
            texels: Vec::new(),
            instances,
            measured: Vec::new(),
        };
        let shares = worst_under_lights(&scores, &SceneId::new("s").unwrap());
        assert_eq!(shares.iter().map(|share| share.instance.as_str()).collect::<Vec<_>>(), ["a", "b"]);
        assert!((shares[0].share - 0.8).abs() < 1e-12 && (shares[0].mse - 0.2).abs() < 1e-12);
        assert!(worst_under_lights(&scores, &SceneId::new("t").unwrap()).is_empty());
    }

    /// Text and page hold the same numbers, and the rows of a table have the same length.
    #[test]
    fn text_and_page() {
        let kinds = KindShares {
            unobserved: 0.25,
            scale: 0.25,
            chroma: 0.25,
            shading: 0.125,
            misplacement: 0.125,
            detail: 0.0,
            rest: 0.0,
        };
        let file = super::file::ExplainFile {
            format: super::file::EXPLAIN_FORMAT.to_owned(),
            tool: String::new(),
            method: "m".to_owned(),
            submission_sha256: String::new(),
            dataset_manifest_sha256: String::new(),
            protocol: "mateval-3".to_owned(),
            fingerprint: String::new(),
            scene: SceneId::new("s").unwrap(),
            views: vec![mateval_dataset::ViewId::new("input").unwrap()],
            pixels: 12,
            unobserved_pixels: 3,
            mse: 0.01,
            psnr: 20.0,
            kinds: Some(kinds),
            instances: Vec::new(),
            alignments: Vec::new(),
            light: Vec::new(),
            findings: Vec::new(),
        };
        let plain = text::plain(&file, None);
        assert!(
            plain.starts_with("m, scene s: albedo MSE 10.000 (1e-3, linear), PSNR 20.00 dB, over 12 pixels in 1 views")
        );
        assert!(plain.contains("(whole scene)"), "{plain}");
        let first =
            "25.0 % of the squared error lies in the 25.0 % of the pixels whose surface the photo does not show.";
        assert_eq!(plain.lines().nth(1), Some(first));
        let narrow = text::plain(&file, Some(80));
        assert!(narrow.lines().all(|line| line.chars().count() <= 80), "{narrow}");
        let words = |text: &str| text.split_whitespace().count();
        assert!(words(&narrow) >= words(&plain), "{narrow}");
        let page = text::markdown(&file, &[]);
        let row = "| (whole scene) |  | 100.0 | 12 | 10.000 | 25.0 | 25.0 | 25.0 | 12.5 | 12.5 | 0.0 | 0.0 |\n";
        assert!(page.contains(row), "{page}");
        let lengths: Vec<usize> = page
            .lines()
            .take_while(|line| !line.starts_with("## What"))
            .filter(|line| line.starts_with('|'))
            .map(|line| line.matches('|').count())
            .collect();
        assert_eq!(lengths, [13; 3]);
    }
}
