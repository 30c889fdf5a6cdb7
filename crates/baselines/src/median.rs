//! One colour per instance or per part: the median of an estimate inside its mask.
//!
//! IM2CAD (Izadinia et al., CVPR 2017) colours furniture in this way, per instance; procedural methods fall back to it
//! per part.

use std::path::Path;

use mateval_dataset::open::Dataset;
use mateval_dataset::{PartSetId, Progress};

use crate::error::BaselineError;
use crate::estimate::{Estimate, Values};
use crate::estimate_source::EstimateSource;
use crate::geometry::{PartTriangles, SceneGeometry, SeenPixels};
use crate::maps::{Maps, Medians, PartColors, lower_median};
use crate::nn::seen_pixels;
use crate::submission::{Method, write_scenes};

/// What has one colour.
#[derive(Clone, Copy, Debug)]
pub enum MedianOf<'a> {
    Instances,
    /// The parts of a set; `None` stands for the parts of the source.
    Parts(Option<&'a PartSetId>),
}

impl MedianOf<'_> {
    fn method(self, dataset: &Dataset, source: &EstimateSource) -> Method {
        let (mut name, masks) = match self {
            Self::Instances => ("median".to_owned(), "each instance's mask".to_owned()),
            Self::Parts(set) => (
                set.map_or("median-part".to_owned(), |set| format!("median-part-{set}")),
                format!(
                    "the mask of each of {}; a part that is not seen takes its instance's",
                    set.map_or("the source's own parts".to_owned(), |set| format!("the parts '{set}'"))
                ),
            ),
        };
        // The input picture is the default of this method.
        if !matches!(source, EstimateSource::Input) {
            name = format!("{name}-{}", source.name());
        }
        let description = format!(
            "the median of {} under {masks}; what is not seen takes the median of its category in the picture, else base \
             colour 0.5 (linear)",
            source.description(dataset)
        );
        Method { name, description, assumed_encodings: source.assumed_encodings(), is_oracle: source.is_truth() }
    }
}

/// Writes a submission and returns the number of instances.
pub fn write(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    source: &EstimateSource,
    of: MedianOf<'_>,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    write_scenes(dataset, out, force, &of.method(dataset, source), progress, |scene, folder| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let estimate = source.read(dataset, scene, progress)?;
        let seen = seen_pixels(&geometry, &estimate)?;
        let medians = Medians::new(&geometry, &seen, &estimate);
        let parts = match of {
            MedianOf::Instances => None,
            MedianOf::Parts(set) => Some(colors_of_parts(&geometry, set, &estimate, &seen, &medians)?),
        };
        let mut written = 0;
        for (at, instance) in scene.instances.iter().enumerate() {
            let Some(atlas) = &instance.atlas else { continue };
            let maps = match &parts {
                None => Maps::constant(medians.of(&geometry, at), estimate.given_maps()),
                Some(parts) => Maps::of_atlas(&parts.paint(&geometry, at, atlas.size as usize), estimate.given_maps()),
            };
            maps.write(&folder.join(instance.id.as_str()))?;
            written += 1;
        }
        Ok(written)
    })
}

/// The median of each part, or that of its instance where the part is not seen.
fn colors_of_parts<'a>(
    geometry: &SceneGeometry<'a>,
    set: Option<&PartSetId>,
    estimate: &Estimate,
    seen: &SeenPixels,
    medians: &Medians,
) -> Result<PartColors<'a>, BaselineError> {
    let triangles = PartTriangles::read(geometry, set)?;
    let picture = geometry.part_picture(set)?;
    let place_of = triangles.place_of_index();
    let mut pixels: Vec<Vec<Values>> = vec![Vec::new(); triangles.parts.len()];
    for (x, y, _) in seen.shown_pixels() {
        let (x_of_view, y_of_view) = seen.view_pixel(x, y);
        if let Some(&at) = place_of.get(&picture.get(x_of_view, y_of_view)) {
            pixels[at].push(estimate.at(x, y));
        }
    }
    Ok(PartColors::new(triangles, |part, instance| {
        let pixels = &mut pixels[part];
        Some(if pixels.is_empty() { medians.of(geometry, instance) } else { lower_median(pixels) })
    }))
}
