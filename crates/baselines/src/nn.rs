//! Lifting by nearest neighbours: extends an estimate of the input view to whole atlases (the paper's strongest
//! family).
//!
//! Seen texels hold the estimate. An unseen texel is computed from the nearest seen points of its instance. An instance
//! that is not seen at all takes the median of its category in the picture, or else grey.

use std::path::Path;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_dataset::{Progress, Report};
use mateval_image::{Mask, Picture};
use rayon::prelude::*;

use crate::error::BaselineError;
use crate::estimate::{Estimate, Values};
use crate::estimate_source::EstimateSource;
use crate::fill::{FillRule, SeenCloud};
use crate::geometry::{SceneGeometry, SeenPixels, SeenPoint};
use crate::lift::{Lifter, Texel};
use crate::maps::{DEFAULT, Maps, Medians};
use crate::submission::{self, Method};

/// How unseen texels are filled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NnOptions {
    /// How many points are used, and how distances are measured.
    pub rule: FillRule,
    /// Whether the seen points of all instances are searched, not only those of the texel's own instance.
    pub any_instance: bool,
    /// Width and height of every atlas, in texels; `None` stands for the dataset's own size of each instance.
    pub atlas_size: Option<u32>,
}

impl NnOptions {
    fn description(&self, estimate: &str) -> String {
        let count = self.rule.neighbours;
        let mean = if count.get() == 1 { "the nearest seen point" } else { "an inverse-square mean of the nearest" };
        let near = if count.get() == 1 { String::new() } else { format!(" {count}") };
        let whose = if self.any_instance { "any instance" } else { "the same instance" };
        let normals = match self.rule.normal_weight_m {
            weight if weight > 0.0 => format!(", opposite normals counting as {weight} m"),
            _ => String::new(),
        };
        let texels = format!("{estimate} lifted to the atlases; unseen texels: {mean}{near} of {whose}{normals}");
        if self.any_instance {
            return texels;
        }
        format!(
            "{texels}; instances that are not seen: the median of their category in the picture, else base colour 0.5 \
             (linear), roughness 0.5, metallic 0"
        )
    }
}

/// Writes a submission and returns the number of instances.
pub fn write(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    source: &EstimateSource,
    options: &NnOptions,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    let method = Method {
        name: format!("nn-{}", source.name()),
        description: options.description(&source.description(dataset)),
        assumed_encodings: source.assumed_encodings(),
        is_oracle: source.is_truth(),
    };
    submission::write_scenes(dataset, out, force, &method, progress, |scene, folder| {
        write_scene(dataset, scene, folder, source, options, progress)
    })
}

/// Writes the maps of one scene, with one folder per instance below `folder`, and returns the number of instances.
pub fn write_scene(
    dataset: &Dataset,
    scene: &SceneFile,
    folder: &Path,
    source: &EstimateSource,
    options: &NnOptions,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
    let estimate = source.read(dataset, scene, progress)?;
    let seen = seen_pixels(&geometry, &estimate)?;
    lift_scene(&geometry, &estimate, &seen, options, progress, |instance, lifted, medians| {
        let maps = match lifted {
            Some(lifted) => lifted.maps,
            None => Maps::constant(medians.of(&geometry, instance), estimate.given_maps()),
        };
        maps.write(&folder.join(geometry.scene.instances[instance].id.as_str()))
    })
}

/// An instance's atlas after lifting and filling.
pub struct Lifted {
    /// The triangle that each texel belongs to.
    pub atlas: UvAtlas,
    /// The maps, with filled gutters.
    pub maps: Maps,
    /// Whether each texel was seen before filling.
    pub seen: Mask,
}

/// Determines which instance each pixel of the estimate shows.
pub fn seen_pixels(geometry: &SceneGeometry<'_>, estimate: &Estimate) -> Result<SeenPixels, BaselineError> {
    let view = (geometry.valid.width(), geometry.valid.height());
    let region = estimate.region(geometry.scene.id.as_str(), view)?;
    let size = estimate.size().unwrap_or(view);
    Ok(SeenPixels::of_region(geometry, size, region))
}

/// Lifts an estimate to every instance that has an atlas, several at once. `each` receives the instance's index and its
/// atlas, or `None` where no point that it could be filled from is seen. Returns the number of instances.
pub fn lift_scene(
    geometry: &SceneGeometry<'_>,
    estimate: &Estimate,
    seen: &SeenPixels,
    options: &NnOptions,
    progress: Progress<'_>,
    each: impl Fn(usize, Option<Lifted>, &Medians) -> Result<(), BaselineError> + Sync,
) -> Result<usize, BaselineError> {
    let medians = Medians::new(geometry, seen, estimate);
    let with_atlas: Vec<(usize, usize)> = geometry
        .scene
        .instances
        .iter()
        .enumerate()
        .filter_map(|(at, instance)| Some((at, options.atlas_size.unwrap_or(instance.atlas.as_ref()?.size) as usize)))
        .collect();
    let points: Vec<(SeenPoint, Values)> =
        seen.points(geometry).into_iter().map(|point| (point, estimate.at(point.pixel.0, point.pixel.1))).collect();
    let all = options.any_instance.then(|| SeenCloud::new(options.rule, points.iter().copied()));
    let lifted = |instance: usize, size: usize| {
        let own;
        let cloud = match &all {
            Some(all) => all,
            None => {
                let of_instance = points.iter().filter(|(point, _)| point.instance == instance).copied();
                own = SeenCloud::new(options.rule, of_instance);
                &own
            }
        };
        if cloud.is_empty() {
            return None;
        }
        let mesh = geometry.mesh(instance);
        let atlas = UvAtlas::new(mesh, size);
        let lifter = Lifter::new(geometry, seen, estimate, instance, &atlas);
        let (mut maps, mut shown) =
            (Maps::filled(size, DEFAULT, estimate.given_maps()), Picture::filled(size, size, false));
        // A texel's values take four times the memory of its bytes in the maps, so only rows of them are kept.
        let rows = maps.rows(size).into_par_iter().zip(shown.pixels_mut().par_chunks_mut(size)).enumerate();
        rows.for_each_init(
            || vec![Texel::Unused; size],
            |texels, (y, (mut maps, shown))| {
                lifter.row(y, texels);
                shown.iter_mut().zip(&*texels).for_each(|(shown, texel)| *shown = texel.seen().is_some());
                cloud.fill_row(&atlas, mesh, y, texels);
                maps.set(texels);
            },
        );
        maps.fill_gutters(&atlas);
        Some(Lifted { atlas, maps, seen: shown })
    };
    let (step, mut done) = (format!("{} lift", geometry.scene.id), 0);
    for batch in batches(&with_atlas) {
        progress(Report::step(&step, done, with_atlas.len()));
        batch.par_iter().try_for_each(|&(instance, size)| each(instance, lifted(instance, size), &medians))?;
        done += batch.len();
    }
    progress(Report::step(&step, done, with_atlas.len()));
    Ok(with_atlas.len())
}

/// The most texels of atlases that are worked on at once, unless one atlas has more: a bound on memory. The rows of
/// each are spread over the threads, so that a batch of one atlas keeps all of them at work.
const BATCH_TEXELS: usize = 2048 * 2048;

/// Splits the instances, each given with its atlas's width, into batches of at most [`BATCH_TEXELS`].
fn batches(with_atlas: &[(usize, usize)]) -> Vec<&[(usize, usize)]> {
    let (mut batches, mut first, mut texels) = (Vec::new(), 0, 0);
    for (at, (_, size)) in with_atlas.iter().enumerate() {
        if at > first && texels + size * size > BATCH_TEXELS {
            batches.push(&with_atlas[first..at]);
            (first, texels) = (at, 0);
        }
        texels += size * size;
    }
    batches.push(&with_atlas[first..]);
    batches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_batch_is_bounded_by_its_texels() {
        let sizes = |sizes: &[usize]| -> Vec<Vec<usize>> {
            let all: Vec<(usize, usize)> = sizes.iter().copied().enumerate().collect();
            batches(&all).into_iter().map(|batch| batch.iter().map(|(_, size)| *size).collect()).collect()
        };
        assert_eq!(sizes(&[1024, 1024, 1024, 1024, 64]), [vec![1024; 4], vec![64]]);
        assert_eq!(sizes(&[64, 4096, 64, 2048]), [vec![64], vec![4096], vec![64], vec![2048]]);
    }
}
