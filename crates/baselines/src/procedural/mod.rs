//! Procedural materials (after PSDR-Room, Yan et al. 2023): a graph for each part, fitted to an estimate.
//!
//! In: the public geometry of a scene and an estimate of its input view. Out: a submission, and a report beside it with
//! the graphs as MaterialX.
//!
//! Each part's surface is laid out flat in metres, as the unfolded sides of a box (`part_frame`). The pixels that
//! show its most visible side become points of that layout (`part_samples`), to which the graphs of
//! [`mateval_procedural`] are fitted (`part_material`). Where a graph predicts held-out pixels better than a single
//! colour does, it is baked to the atlas (`bake`); all other parts have the median of their pixels.

use std::collections::BTreeMap;

use mateval_scene::Progress;

use self::scene_materials::SceneMaterials;
use crate::error::BaselineError;
use crate::estimate::Estimate;
use crate::geometry::SceneGeometry;
use crate::nn::seen_pixels;

mod bake;
mod files;
mod fitted_graphs;
mod interpolation;
mod materials_file;
mod options;
mod page;
mod part_frame;
mod part_material;
mod part_samples;
mod pictures;
mod report_file;
mod residuals;
mod scene_materials;

pub use bake::Baked;
pub use files::{report_folder, write};
pub use options::{FitMode, ProceduralOptions};

/// The maps of every instance of a scene that has an atlas, by its place in the scene: what [`write()`] writes, without
/// files.
pub fn scene_maps(
    geometry: &SceneGeometry<'_>,
    estimate: &Estimate,
    options: &ProceduralOptions,
    progress: Progress<'_>,
) -> Result<BTreeMap<usize, Baked>, BaselineError> {
    let seen = seen_pixels(geometry, estimate)?;
    let materials =
        SceneMaterials::fitted(geometry, estimate, &seen, &fitted_graphs::fitter(options)?, options, progress)?;
    let mut all = BTreeMap::new();
    bake::bake_all(&materials, geometry, estimate, &seen, options.keep_seen, |at, baked| {
        all.insert(at, baked);
        Ok(())
    })?;
    Ok(all)
}
