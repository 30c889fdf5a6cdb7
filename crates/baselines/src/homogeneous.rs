//! One colour per instance or per part: the median of an estimate inside its mask; and `grey`, the floor: one colour
//! for every surface.
//!
//! IM2CAD (Izadinia et al., CVPR 2017) colours furniture in this way, per instance; procedural methods fall back to it
//! per part.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::open::Dataset;
use mateval_dataset::submission::{GREY, MAP_SIZES, Map};
use mateval_dataset::{PartSetId, Progress};
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{Picture, png_io};

use crate::error::BaselineError;
use crate::estimate::{Estimate, Values};
use crate::estimate_source::EstimateSource;
use crate::geometry::{PartTriangles, SceneGeometry};
use crate::maps::{Maps, Medians, PartColors, median};
use crate::nn::seen_pixels;
use crate::submission::{self, Method};

/// Writes base colour 0.5 (linear) for every instance and returns their number. Roughness and metallic have no files,
/// so that the format's defaults hold.
pub fn write_grey(dataset: &Dataset, out: &Path, force: bool) -> Result<usize, BaselineError> {
    let texel = [byte_from_unit(srgb_from_linear(GREY)); 3];
    let size = *MAP_SIZES.start();
    let method = Method::new("grey", "base colour 0.5 (linear) everywhere, roughness 0.5, metallic 0");
    submission::write(dataset, out, force, &method, &|_| (), |_, _, folder| {
        let path = folder.join(Map::BaseColor.stem()).with_extension("png");
        Ok(png_io::write_rgb_bytes(&path, &Picture::filled(size, size, texel))?)
    })
}

const UNSEEN: &str = "what is not seen takes the median of its category in the picture, else base colour 0.5 (linear)";

/// Writes a submission with one colour per instance and returns the number of instances.
pub fn write_by_instance(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    source: &EstimateSource,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    let description = format!("the median of {} under each instance's mask; {UNSEEN}", source.description(dataset));
    let assumed_encodings = source.assumed_encodings();
    let method = Method { name: name("median", source), description, assumed_encodings };
    submission::write_scenes(dataset, out, force, &method, progress, |scene, folder| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let estimate = source.read(dataset, scene, progress)?;
        let medians = Medians::new(&geometry, &seen_pixels(&geometry, &estimate)?, &estimate);
        let mut written = 0;
        for (at, instance) in scene.instances.iter().enumerate().filter(|(_, instance)| instance.atlas.is_some()) {
            Maps::constant(medians.of(&geometry, at), estimate.given_maps())
                .write(&folder.join(instance.id.as_str()))?;
            written += 1;
        }
        Ok(written)
    })
}

/// Writes a submission with one colour per part of the set and returns the number of instances. An unseen part takes
/// the median of its instance.
pub fn write_by_part(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    source: &EstimateSource,
    set: Option<&PartSetId>,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    let parts = set.map_or("the source's own parts".to_owned(), |set| format!("the parts '{set}'"));
    let description = format!(
        "the median of {} under the mask of each of {parts}; a part that is not seen takes its instance's; {UNSEEN}",
        source.description(dataset)
    );
    let stem = set.map_or("median-part".to_owned(), |set| format!("median-part-{set}"));
    let assumed_encodings = source.assumed_encodings();
    let method = Method { name: name(&stem, source), description, assumed_encodings };
    submission::write_scenes(dataset, out, force, &method, progress, |scene, folder| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let estimate = source.read(dataset, scene, progress)?;
        let parts = colors_of_parts(&geometry, set, &estimate)?;
        let mut written = 0;
        for (at, instance) in scene.instances.iter().enumerate() {
            let Some(atlas) = &instance.atlas else { continue };
            let known = parts.paint(&geometry, at, atlas.size as usize);
            Maps::of_atlas(&known, estimate.given_maps()).write(&folder.join(instance.id.as_str()))?;
            written += 1;
        }
        Ok(written)
    })
}

/// The method's name; the source is left out where it is the input picture, the default of these methods.
fn name(stem: &str, source: &EstimateSource) -> String {
    match source {
        EstimateSource::Input => stem.to_owned(),
        other => format!("{stem}-{}", other.name()),
    }
}

/// The median of each part, or that of its instance where the part is not seen.
fn colors_of_parts<'a>(
    geometry: &SceneGeometry<'a>,
    set: Option<&PartSetId>,
    estimate: &Estimate,
) -> Result<PartColors<'a>, BaselineError> {
    let triangles = PartTriangles::read(geometry, set)?;
    let picture = geometry.part_picture(set)?;
    let seen = seen_pixels(geometry, estimate)?;
    let medians = Medians::new(geometry, &seen, estimate);
    let mut pixels: Vec<Vec<Values>> = vec![Vec::new(); triangles.parts.len()];
    let place_of: BTreeMap<u16, usize> =
        triangles.parts.iter().enumerate().map(|(at, part)| (part.index.0.get(), at)).collect();
    for (x, y, _) in seen.shown_pixels() {
        let (x_of_view, y_of_view) = seen.view_pixel(x, y);
        if let Some(&at) = place_of.get(&picture.get(x_of_view, y_of_view)) {
            pixels[at].push(estimate.at(x, y));
        }
    }
    Ok(PartColors::new(triangles, |part, instance| {
        let pixels = &mut pixels[part];
        Some(if pixels.is_empty() { medians.of(geometry, instance) } else { median(pixels) })
    }))
}
