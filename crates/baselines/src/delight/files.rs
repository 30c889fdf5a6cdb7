//! The files of `mateval baseline delight`: pictures, `lights.json`, and a page with what was found in each photo.

use std::path::Path;

use mateval_dataset::open::Dataset;
use mateval_dataset::{Progress, Report, json};
use mateval_files::FileError;
use mateval_files::work_folder::{WorkFolder, make_folder};
use mateval_image::exr_io::{Precision, write_grey, write_linear};
use mateval_image::png_io::{write_grey_bytes, write_srgb};
use mateval_image::{LinearRgb, Picture, SrgbRgb};
use mateval_pages::{figure, plain};
use schemars::JsonSchema;
use serde::Serialize;

use super::room::FittedLight;
use super::{CandidateLights, DelightOptions, DelitPhoto, delight};
use crate::error::BaselineError;
use crate::geometry::SceneGeometry;
use crate::submission::check_new_place;

/// `lights.json` of a de-lit photo: the lights that were fitted to it.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedLightsFile<'a> {
    /// Always `mateval-fitted-lights/2`.
    format: &'static str,
    /// Which lights were given the chance to shine.
    candidates: CandidateLights,
    /// Candidates of the room first, then the lights of the stage.
    lights: &'a [FittedLight],
}

/// De-lights the photo of every scene. `out` receives `index.html` and for each scene a folder with `base_color.exr`,
/// `roughness.exr`, `metallic.exr`, `shading.exr`, `gloss.exr`, `confidence.exr`, the same as PNG for the page with
/// `photo.png`, and `lights.json`. Returns the number of scenes.
pub fn write(
    dataset: &Dataset,
    out: &Path,
    options: &DelightOptions,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    check_new_place(dataset, out)?;
    let work = WorkFolder::start(out)?;
    let mut sections = String::new();
    for (at, scene) in dataset.scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, dataset.scenes.len()));
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let delit = delight(&geometry, options, progress)?;
        let folder = work.path().join(scene.id.as_str());
        make_folder(&folder)?;
        write_pictures(&folder, &delit, scene.exposure as f32)?;
        let format = "mateval-fitted-lights/2";
        let lights = FittedLightsFile { format, candidates: options.lights, lights: &delit.lights };
        json::write(&folder.join("lights.json"), &lights)?;
        sections.push_str(&section(scene.id.as_str(), &delit));
    }
    let index = work.path().join("index.html");
    // Ids and names of lights contain no characters that are special in HTML.
    let introduction = "A photo is base colour times the light on a white surface, plus light that does not depend on \
                        base colour.";
    std::fs::write(&index, plain("De-lit photos", introduction, &sections, ""))
        .map_err(FileError::io("write", &index))?;
    work.finish()?;
    Ok(dataset.scenes.len())
}

/// `exposure` is that of the scene, for the pictures that people look at.
fn write_pictures(folder: &Path, delit: &DelitPhoto, exposure: f32) -> Result<(), BaselineError> {
    write_srgb(&folder.join("photo.png"), &exposed(&delit.photo, exposure))?;
    let colors = [
        ("base_color", &delit.base_color, 1.0),
        ("shading", &delit.shading, exposure),
        ("gloss", &delit.gloss, exposure),
    ];
    for (name, picture, factor) in colors {
        // Radiances may exceed what halves hold.
        write_linear(&folder.join(format!("{name}.exr")), picture, Precision::Float)?;
        write_srgb(&folder.join(format!("{name}.png")), &exposed(picture, factor))?;
    }
    let scalars = [("roughness", &delit.roughness), ("metallic", &delit.metallic), ("confidence", &delit.confidence)];
    for (name, picture) in scalars {
        write_grey(&folder.join(format!("{name}.exr")), picture, Precision::Half)?;
        let bytes = picture.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
        write_grey_bytes(&folder.join(format!("{name}.png")), &bytes)?;
    }
    Ok(())
}

/// A linear picture times `exposure` as people see it.
fn exposed(picture: &Picture<LinearRgb>, exposure: f32) -> Picture<SrgbRgb> {
    picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (v * exposure).clamp(0.0, 1.0)))).to_srgb()
}

const PICTURES: [(&str, &str); 7] = [
    ("photo", "The photo"),
    ("base_color", "Base colour"),
    ("shading", "Light on a white surface, exposed as the photo"),
    ("gloss", "Light that does not depend on base colour"),
    ("confidence", "Confidence: black is unknown"),
    ("roughness", "Roughness"),
    ("metallic", "Metallic: white is a mirror"),
];

fn section(id: &str, delit: &DelitPhoto) -> String {
    let mut text = format!("<section><h2>{id}</h2><div class=\"row\">\n");
    text.extend(PICTURES.map(|(file, caption)| figure(&format!("{id}/{file}.png"), id, caption)));
    let (count, rounds) = (delit.lights.len(), delit.rounds);
    text.push_str(&format!(
        "</div><details><summary>{count} lights after {rounds} rounds</summary><div class=\"wide\"><table><thead><tr>\
         <th>Light</th><th>Red</th><th>Green</th><th>Blue</th></tr></thead><tbody>\n"
    ));
    text.extend(delit.lights.iter().map(|FittedLight { light, radiance: [r, g, b] }| {
        format!("<tr><th scope=\"row\">{}</th><td>{r:.4}</td><td>{g:.4}</td><td>{b:.4}</td></tr>\n", light.name)
    }));
    text.push_str("</tbody></table></div></details></section>\n");
    text
}
