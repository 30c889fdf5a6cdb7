//! How far converted materials are from the source's own, by the built-in tracer's pictures of both.

use std::sync::Arc;

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_metrics::Psnr;
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::SceneFolder;
use mateval_scene::{Progress, reference_io};
use mateval_tracer::World;

use super::file::SourceComparison;
use super::geometry::OurGeometry;
use super::kind::MaterialKind;
use super::light::{self, ShownKinds};
use super::ours;
use super::tiles::Halves;
use crate::error::AuditError;

/// A view of a scene, rendered with its converted materials.
pub(super) struct Converted<'a> {
    pub(super) folder: &'a SceneFolder,
    pub(super) scene: &'a SceneFile,
    pub(super) view: &'a View,
    pub(super) world: &'a World,
    pub(super) rgb: &'a Halves,
    pub(super) kinds: &'a [MaterialKind],
    pub(super) tile_bound: f64,
}

impl Converted<'_> {
    /// Renders the view with the source's own materials and compares; none where the materials were not converted.
    pub(super) fn compare(&self, samples: u32, progress: Progress<'_>) -> Result<Option<SourceComparison>, AuditError> {
        let reference = self.world.scene();
        let Some(source) = reference_io::read_source_materials(self.folder, reference.materials.len())? else {
            return Ok(None);
        };
        let theirs = World::sharing(Arc::new(source.in_scene(reference)), self.world.accel().clone())?;
        let theirs = ours::render(&theirs, &self.scene.id, &[self.view], samples, progress)?;
        let Some(theirs) = theirs.first().map(|light| &light.rgb) else { return Ok(None) };
        let geometry = OurGeometry::read(self.folder, self.view, self.world)?;
        let shown = ShownKinds::new(&geometry.instance, self.kinds, &geometry.valid);
        let (light, _) = light::compare("rgb", None, [self.rgb, theirs], &shown, self.tile_bound);
        let error = self.error_without_noise(theirs, &geometry.valid).filter(|error| *error > 0.0);
        let psnr_db = error.and_then(|error| Psnr::from_mse(error).ok()).map(|psnr| psnr.db);
        Ok(Some(SourceComparison { view: self.view.id.clone(), psnr_db, light }))
    }

    /// The mean over valid pixels of the product of the halves' errors, which are independent of each other, as a preview
    /// shows them; none where no pixel is valid.
    fn error_without_noise(&self, theirs: &Halves, valid: &Mask) -> Option<f64> {
        let errors = [(&self.rgb.a, &theirs.a), (&self.rgb.b, &theirs.b)]
            .map(|(ours, theirs)| (self.exposed(ours).to_srgb(), self.exposed(theirs).to_srgb()));
        let (mut sum, mut count) = (0.0, 0_usize);
        for at in (0..valid.pixels().len()).filter(|at| valid.pixels()[*at]) {
            for channel in 0..3 {
                let [a, b] = [&errors[0], &errors[1]].map(|(ours, theirs)| {
                    f64::from(theirs.pixels()[at].0[channel]) - f64::from(ours.pixels()[at].0[channel])
                });
                sum += a * b;
            }
            count += 3;
        }
        (count > 0).then(|| sum / count as f64)
    }

    fn exposed(&self, picture: &Picture<LinearRgb>) -> Picture<LinearRgb> {
        let exposure = self.scene.exposure as f32;
        picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|value| (value * exposure).clamp(0.0, 1.0))))
    }
}
