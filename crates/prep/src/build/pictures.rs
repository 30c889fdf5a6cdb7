//! Writes the pictures of every view of a scene, and notes what they show.

use mateval_dataset::layout::{INPUT, SceneFolder, part_picture};
use mateval_dataset::{Finding, Progress, Report, SceneId, Severity, ViewId};
use mateval_image::exr_io::{self, Precision};
use mateval_image::png_io;
use mateval_tracer::World;

use super::fault::{BuildFault, above_notes};
use super::plan::Plan;
use crate::error::PrepError;
use crate::views::{GeometryPictures, Shown, TruthPictures, ViewScene, write_views};

/// What the pictures of all views show.
pub(super) struct Seen {
    /// The nearest depth in metres at which the input view shows each instance, or where it does not, any other view.
    pub(super) nearest: Vec<Option<f64>>,
    /// The share of the valid pixels of each view that the input view does not show.
    pub(super) unseen_shares: Vec<f64>,
    /// For each instance, how many valid pixels of the input view show it.
    pub(super) input_pixels: Vec<usize>,
    /// Findings about views that are of little use.
    pub(super) findings: Vec<Finding>,
}

impl Seen {
    /// Fails if the input view shows nothing that is scored.
    pub(super) fn or_refuse(self, scene: &SceneId, plan: &Plan) -> Result<Self, PrepError> {
        if self.input_pixels.iter().any(|count| *count > 0) {
            return Ok(self);
        }
        Err(PrepError::scene(scene)(BuildFault::NothingSeen {
            captured: !plan.source.kind.states_materials(),
            findings: above_notes(&plan.findings),
        }))
    }
}

/// A surface that is nearer than this, in metres, fills the picture with a few texels; one that contains the camera
/// fills it with noise.
const TOO_NEAR_M: f64 = 0.001;

/// Writes the pictures of every view. `scored` states for each instance whether it has an atlas.
pub(super) fn write_pictures(
    plan: &Plan,
    folder: &SceneFolder,
    scored: &[bool],
    progress: Progress<'_>,
) -> Result<Seen, PrepError> {
    let world = World::new(plan.scene.clone())?;
    let instances: Vec<u16> = plan.instances.iter().map(|entry| entry.index.0.get()).collect();
    let parts: Vec<(String, Vec<Vec<u16>>)> =
        plan.part_splits.iter().map(|split| (part_picture(split.id.as_ref()), split.values())).collect();
    let scene = ViewScene::new(&plan.scene, &world, &instances, scored);
    let views = plan.views.len();
    progress(Report::step("views", 0, views));
    let (mut findings, mut input_pixels) = (Vec::new(), Vec::new());
    let Shown { nearest, unseen_shares } = write_views(folder, &scene, &plan.views, &parts, |at, geometry, truth| {
        let view = &plan.views[at].id;
        check_use(plan, view, geometry, &mut findings);
        if at == 0 {
            input_pixels = valid_pixels(geometry, plan.instances.len());
        }
        write_truth(folder, view, truth)?;
        progress(Report::step("views", at + 1, views));
        Ok(())
    })?;
    Ok(Seen { nearest, unseen_shares, input_pixels, findings })
}

/// Adds a finding where a view is of little use: no pixel is valid, or a surface is too near to the camera.
fn check_use(plan: &Plan, view: &ViewId, geometry: &GeometryPictures, findings: &mut Vec<Finding>) {
    let mut warn = |code: &str, message: String, action: &str| {
        findings.push(Finding::new(
            Severity::Warning,
            code,
            plan.file.clone(),
            format!("view '{view}'"),
            message,
            action,
        ));
    };
    let nearest = geometry.depth.pixels().iter().copied().filter(|depth| *depth > 0.0).reduce(f32::min);
    if let Some(nearest) = nearest.filter(|nearest| f64::from(*nearest) < TOO_NEAR_M) {
        let message = format!("a surface is {nearest:.1e} m in front of the camera, expected {TOO_NEAR_M} m or more");
        warn("camera_too_near", message, "kept the view; choose another camera, since so near a surface may be noise");
    }
    if view.as_str() != INPUT && !geometry.valid.pixels().contains(&true) {
        let message = "the camera sees nothing that is scored: no pixel is valid".to_owned();
        warn("nothing_seen", message, "kept the view; it adds nothing to any score");
    }
}

/// For each instance, how many valid pixels show it.
fn valid_pixels(geometry: &GeometryPictures, instances: usize) -> Vec<usize> {
    let mut count = vec![0; instances];
    for (instance, _) in geometry.instance.pixels().iter().zip(geometry.valid.pixels()).filter(|(_, valid)| **valid) {
        if let Some(place) = usize::from(*instance).checked_sub(1) {
            count[place] += 1;
        }
    }
    count
}

fn write_truth(folder: &SceneFolder, view: &ViewId, truth: &TruthPictures) -> Result<(), PrepError> {
    let hidden = folder.truth_view(view);
    exr_io::write_linear(&hidden.join("albedo.exr"), &truth.albedo, Precision::Float)?;
    exr_io::write_linear(&hidden.join("diffuse_albedo.exr"), &truth.diffuse_albedo, Precision::Float)?;
    exr_io::write_scalar(&hidden.join("roughness.exr"), &truth.roughness, Precision::Float)?;
    exr_io::write_scalar(&hidden.join("metallic.exr"), &truth.metallic, Precision::Float)?;
    png_io::write_mask(&hidden.join("specular_region.png"), &truth.specular_region)?;
    Ok(())
}
