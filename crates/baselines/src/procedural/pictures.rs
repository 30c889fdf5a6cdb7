//! The pictures of the report page.

use std::path::Path;

use mateval_image::png_io::write_srgb;
use mateval_image::{LinearRgb, Picture, SrgbRgb};

use super::part_material::PartMaterial;
use super::part_samples::PartSamples;
use super::scene_materials::SceneMaterials;
use crate::error::BaselineError;
use crate::estimate::{Estimate, GivenMaps};
use crate::placement::Placement;

/// Pixels of a margin around what shows a part.
const MARGIN: usize = 4;

/// Side of a swatch in pixels.
const SWATCH: usize = 192;

/// The colour of pixels that show no part.
const NO_PART_COLOR: LinearRgb = LinearRgb([0.2; 3]);

/// Writes `photo.png`, if there is one, `estimate.png` and `fitted.png`, and for each part with a fit the same as
/// `<part>-photo.png` and so on, with `<part>-swatch.png` if it has a graph. Returns whether it wrote the photo: not
/// where the estimate has another size or shows another part of the view.
pub(super) fn write(
    folder: &Path,
    photo: Option<&Picture<SrgbRgb>>,
    estimate: &Estimate,
    materials: &SceneMaterials<'_>,
) -> Result<bool, BaselineError> {
    let given = materials.given;
    let Some((width, height)) = estimate.size() else { return Ok(false) };
    let estimated = Picture::from_fn(width, height, |x, y| {
        let [r, g, b, ..] = estimate.at(x, y);
        LinearRgb([r, g, b].map(|v| v.clamp(0.0, 1.0)))
    });
    let mut fitted = Picture::filled(width, height, NO_PART_COLOR);
    for (part, material) in materials.samples.iter().zip(&materials.of_part) {
        paint(&mut fitted, part, material, given);
    }
    let mut all = vec![("estimate", estimated.to_srgb()), ("fitted", fitted.to_srgb())];
    let shows_all = estimate.placement.unwrap_or_default() != Placement::CentreCrop;
    let photo = photo.filter(|photo| shows_all && photo.same_size(&fitted));
    all.extend(photo.map(|photo| ("photo", photo.clone())));
    for (name, picture) in &all {
        write_srgb(&folder.join(format!("{name}.png")), picture)?;
    }
    let parts = materials.triangles.parts.iter().zip(&materials.samples);
    for ((part, samples), material) in parts.zip(&materials.of_part) {
        if material.fit().is_none() {
            continue;
        }
        for (name, picture) in &all {
            write_srgb(&folder.join(format!("{}-{name}.png", part.id)), &crop(picture, samples))?;
        }
        if let Some(swatch) = swatch(samples, material, given) {
            write_srgb(&folder.join(format!("{}-swatch.png", part.id)), &swatch)?;
        }
    }
    Ok(photo.is_some())
}

/// Gives the pixels that show a part its material.
fn paint(picture: &mut Picture<LinearRgb>, part: &PartSamples, material: &PartMaterial, given: GivenMaps) {
    for (sample, [r, g, b, ..]) in part.samples.iter().zip(material.at(&part.places(), given)) {
        picture.set(sample.pixel[0], sample.pixel[1], LinearRgb([r, g, b]));
    }
}

/// The smallest rectangle around a part's pixels, with a margin.
fn crop(picture: &Picture<SrgbRgb>, part: &PartSamples) -> Picture<SrgbRgb> {
    let range = |axis: usize, size: usize| {
        let places = || part.samples.iter().map(|sample| sample.pixel[axis]);
        let first = places().min().unwrap_or(0).saturating_sub(MARGIN);
        let last = (places().max().unwrap_or(0) + MARGIN).min(size - 1);
        (first, last + 1 - first)
    };
    let ((x, width), (y, height)) = (range(0, picture.width()), range(1, picture.height()));
    Picture::from_fn(width, height, |dx, dy| picture.get(x + dx, y + dy))
}

/// The graph seen from the front: a square around what was fitted, whose pixels are no finer than the estimate's.
fn swatch(part: &PartSamples, material: &PartMaterial, given: GivenMaps) -> Option<Picture<SrgbRgb>> {
    material.graph.as_ref()?;
    let (_, samples) = part.of_main_chart()?;
    let range = |axis: fn(&[f64; 2]) -> f64| {
        let places = samples.iter().map(|sample| axis(&[sample.point.u, sample.point.v]));
        places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
    };
    let ((left, right), (bottom, top)) = (range(|place| place[0]), range(|place| place[1]));
    let footprints = samples.iter().map(|sample| sample.point.footprint);
    let finest = footprints.fold(f64::INFINITY, f64::min);
    let side = (right - left).max(top - bottom).max(finest * SWATCH as f64);
    let pixel = side / SWATCH as f64;
    let middle = [0.5 * (left + right), 0.5 * (bottom + top)];
    let place = |k: usize| {
        let (x, y) = ((k % SWATCH) as f64 + 0.5, (k / SWATCH) as f64 + 0.5);
        [middle[0] - 0.5 * side + x * pixel, middle[1] + 0.5 * side - y * pixel, pixel]
    };
    let places: Vec<[f64; 3]> = (0..SWATCH * SWATCH).map(place).collect();
    let values = material.at(&places, given);
    Some(
        Picture::from_fn(SWATCH, SWATCH, |x, y| {
            let [r, g, b, ..] = values[y * SWATCH + x];
            LinearRgb([r, g, b])
        })
        .to_srgb(),
    )
}
