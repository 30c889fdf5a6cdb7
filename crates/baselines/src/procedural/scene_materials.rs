//! The materials of all parts of a scene.

use std::sync::atomic::{AtomicUsize, Ordering};

use mateval_procedural::fit::choose::Fitter;
use mateval_scene::dataset::Instance;
use mateval_scene::{Progress, Report};
use rayon::prelude::*;

use super::options::ProceduralOptions;
use super::part_material::PartMaterial;
use super::part_samples::PartSamples;
use super::residuals::Residuals;
use crate::error::BaselineError;
use crate::estimate::{Estimate, GivenMaps};
use crate::geometry::SceneGeometry;
use crate::median::{DEFAULT, Medians};
use crate::part_triangles::PartTriangles;
use crate::seen::SeenPixels;

/// The parts of a scene with what was seen of each and its material.
pub(super) struct SceneMaterials<'a> {
    pub(super) triangles: PartTriangles<'a>,
    pub(super) samples: Vec<PartSamples>,
    pub(super) of_part: Vec<PartMaterial>,
    /// By how much the estimate differs from each part's material; none unless seen texels are kept.
    pub(super) residuals: Option<Vec<Residuals>>,
    /// The maps that the estimate gives.
    pub(super) given: GivenMaps,
}

impl<'a> SceneMaterials<'a> {
    /// Fits all parts, several at once. The same on any number of threads.
    pub(super) fn fitted(
        geometry: &SceneGeometry<'a>,
        estimate: &Estimate,
        seen: &SeenPixels,
        fitter: &Fitter,
        options: &ProceduralOptions,
        progress: Progress<'_>,
    ) -> Result<Self, BaselineError> {
        options.check()?;
        let given = estimate.given_maps();
        if !given.base_color {
            return Err(BaselineError::NoColor(geometry.scene.id.to_string()));
        }
        let set = options.part_set.as_ref();
        let triangles = PartTriangles::read(geometry, set)?;
        let samples_of_parts = PartSamples::of_parts(geometry, set, &triangles, estimate, seen)?;
        let medians = Medians::new(geometry, seen, estimate);
        let done = AtomicUsize::new(0);
        let fitted = |(part, samples): (usize, &PartSamples)| {
            let owner = triangles.owners[part];
            let category = owner.and_then(|owner| category(&geometry.scene.instances[owner]));
            let unseen = owner.map_or(DEFAULT, |owner| medians.of(geometry, owner));
            let material = PartMaterial::fitted(fitter, samples, category, options, given, unseen);
            progress(Report::step("fit of parts", 1 + done.fetch_add(1, Ordering::Relaxed), samples_of_parts.len()));
            material
        };
        let of_part = samples_of_parts.par_iter().enumerate().map(fitted).collect::<Result<Vec<_>, _>>()?;
        let samples = samples_of_parts;
        let residuals = |(samples, material)| Residuals::new(samples, material, given);
        let residuals = options.keep_seen.then(|| samples.iter().zip(&of_part).map(residuals).collect());
        Ok(Self { triangles, samples, of_part, residuals, given })
    }

    /// Whether any part of an instance has a graph.
    pub(super) fn has_graph(&self, instance: usize) -> bool {
        let mut parts = self.triangles.owners.iter().zip(&self.of_part);
        parts.any(|(owner, material)| *owner == Some(instance) && material.graph.is_some())
    }
}

/// An instance's category, or the kind of a piece of the building.
fn category(instance: &Instance) -> Option<&str> {
    instance.category.as_deref().or(instance.role.architecture_kind())
}
