//! The pictures of the report page.

use std::path::Path;

use mateval_image::png_io::write_srgb;
use mateval_image::{LinearRgb, Picture, SrgbRgb};

use super::part_material::PartMaterial;
use super::part_samples::PartSamples;
use super::scene_materials::SceneMaterials;
use crate::error::BaselineError;
use crate::estimate::{Estimate, GivenMaps};

/// Pixels of a margin around what shows a part.
const MARGIN: usize = 4;

/// Side of a swatch in pixels.
const SWATCH: usize = 192;

/// The colour of pixels that show no part.
const NOTHING: LinearRgb = LinearRgb([0.2; 3]);

/// Writes `photo.png`, if there is one, `estimate.png` and `fitted.png`, and for each part with a fit the same as
/// `<part>-photo.png` and so on, with `<part>-swatch.png` if it has a graph.
pub(super) fn write(
    folder: &Path,
    photo: Option<&Picture<SrgbRgb>>,
    estimate: &Estimate,
    materials: &SceneMaterials<'_>,
) -> Result<(), BaselineError> {
    let given = materials.given;
    let Some((width, height)) = estimate.size() else { return Ok(()) };
    let estimated = Picture::from_fn(width, height, |x, y| {
        let [r, g, b, ..] = estimate.at(x, y);
        LinearRgb([r, g, b].map(|v| v.clamp(0.0, 1.0)))
    });
    let mut fitted = Picture::filled(width, height, NOTHING);
    for (part, material) in materials.samples.iter().zip(&materials.of_part) {
        paint(&mut fitted, part, material, given);
    }
    let mut all = vec![("estimate", estimated.to_srgb()), ("fitted", fitted.to_srgb())];
    // A photo of another size than the estimate has no crops.
    all.extend(photo.filter(|photo| photo.same_size(&fitted)).map(|photo| ("photo", photo.clone())));
    for (name, picture) in &all {
        write_srgb(&folder.join(format!("{name}.png")), picture)?;
    }
    for ((part, samples), material) in
        { materials.triangles.parts.iter().zip(&materials.samples) }.zip(&materials.of_part)
    {
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
    Ok(())
}

/// Gives the pixels that show a part its material.
fn paint(picture: &mut Picture<LinearRgb>, part: &PartSamples, material: &PartMaterial, given: GivenMaps) {
    let places: Vec<[f64; 3]> =
        part.samples.iter().map(|sample| [sample.point.u, sample.point.v, sample.point.footprint]).collect();
    for (sample, [r, g, b, ..]) in part.samples.iter().zip(material.at(&places, given)) {
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

/// The graph seen from the front: a square as large as what was fitted.
fn swatch(part: &PartSamples, material: &PartMaterial, given: GivenMaps) -> Option<Picture<SrgbRgb>> {
    material.graph.as_ref()?;
    let (_, samples) = part.of_main_chart()?;
    let range = |axis: fn(&[f64; 2]) -> f64| {
        let places = samples.iter().map(|sample| axis(&[sample.point.u, sample.point.v]));
        places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
    };
    let ((left, right), (bottom, top)) = (range(|place| place[0]), range(|place| place[1]));
    let side = (right - left).min(top - bottom);
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
