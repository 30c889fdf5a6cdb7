//! Where a submission's albedo errs in one scene, and how.
//!
//! In: a result, the dataset and the submission that it was made from. Out: an [`ExplainFile`], and pictures of the
//! worst instances.
//!
//! Between: `belongs` checks that all three belong together, `patch` splits the pictures by instance, `kinds` splits
//! the error of each instance by kind (`scales`, `smooth_field`, `shift`, `lost_detail`), `alignments` computes scores
//! after scaling alone, `light` lists the worst instances under each light, `crops` draws the worst instances, and
//! [`text`] prints the explanation.

mod alignments;
mod belongs;
mod crops;
pub mod file;
mod kinds;
mod light;
mod lost_detail;
mod model;
mod patch;
mod plan;
mod scales;
mod shift;
mod smooth_field;
#[cfg(test)]
mod tests;
pub mod text;

pub use plan::{ExplainPlan, WORST};

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_metrics::Psnr;
use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::work_folder::check_free;
use mateval_scene::{Progress, Report, SceneError, ViewId};
use rayon::prelude::*;

use self::file::{EXPLAIN_FORMAT, ExplainFile, InstanceExplanation, ViewShift};
use self::kinds::{Explained, explained};
use self::patch::{Patch, patches};
use crate::error::ReportError;
use mateval_eval::open_scene::scored_views;
use mateval_eval::shown_scene::{SceneAlbedo, scene_albedo};

/// The page that links the pictures.
const PAGE: &str = "explain.md";

/// An explanation, and what is needed to draw its pictures.
pub struct Explanation {
    /// The numbers.
    pub file: ExplainFile,
    views: Vec<SceneAlbedo>,
    /// By index of the instance.
    patches: BTreeMap<u16, Vec<Patch>>,
    /// Indices of the worst instances, worst first.
    worst: Vec<u16>,
}

/// Explains the error of the scene's albedo. Fails if result, dataset and submission do not belong together.
pub fn explain(plan: &ExplainPlan<'_>, progress: Progress<'_>) -> Result<Explanation, ReportError> {
    let scores = belongs::check(plan)?;
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
    let instances = worst_first(scene, &ids, &found, &whole);
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
        alignments: alignments::alignments(plan.scene, &scores.protocol, &views)?,
        light: light::worst(scores, plan.scene),
        findings: plan.findings(),
    };
    belongs::check_scores(scores, &file)?;
    progress(Report::step("kinds of error", 2, 2));
    Ok(Explanation { file, views, patches, worst })
}

/// The explanation of each instance with its index, the one with the largest share first.
fn worst_first(
    scene: &SceneFile,
    views: &[ViewId],
    found: &[(u16, Explained)],
    whole: &Explained,
) -> Vec<(u16, InstanceExplanation)> {
    let explanation = |(index, found): &(u16, Explained)| {
        let instance = scene.instances.iter().find(|instance| instance.index.0.get() == *index)?;
        Some((*index, instance_explanation(views, instance, found, whole)))
    };
    let mut instances: Vec<(u16, InstanceExplanation)> = found.iter().filter_map(explanation).collect();
    instances.sort_by(|(_, a), (_, b)| b.share.total_cmp(&a.share).then_with(|| a.instance.cmp(&b.instance)));
    instances
}

fn instance_explanation(
    views: &[ViewId],
    instance: &Instance,
    found: &Explained,
    whole: &Explained,
) -> InstanceExplanation {
    let shift = |shift: &shift::Shift| ViewShift { view: views[shift.view].clone(), pixels: shift.pixels };
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
        std::fs::create_dir_all(out).map_err(SceneError::io("make", out))?;
        for (index, path) in self.worst.iter().zip(&paths) {
            mateval_image::png_io::write_rgb_bytes(path, &crops::crop(&self.views, &self.patches[index]))?;
        }
        let crops: Vec<text::Crop> = names
            .iter()
            .zip(&self.worst)
            .map(|(name, index)| {
                let view = crops::worst_view(&self.patches[index]);
                text::Crop { file: name.clone(), view: self.file.views[view].clone() }
            })
            .collect();
        mateval_image::store::write_whole(&page, text::markdown(&self.file, &crops).as_bytes())?;
        Ok(paths)
    }
}

/// Fails if the folder `out` already holds an explanation that may not be overwritten. Pictures, whose names are not
/// known yet, are checked when they are written.
pub fn check_out(out: &Path, force: bool) -> Result<(), ReportError> {
    Ok(check_free(&out.join(PAGE), force, "--out")?)
}
