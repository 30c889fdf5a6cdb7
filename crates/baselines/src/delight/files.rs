//! The files of `mateval baseline delight`.

use std::path::Path;

use mateval_image::exr_io::{Precision, write_grey, write_linear};
use mateval_image::png_io::{write_grey_bytes, write_srgb};
use mateval_image::{LinearRgb, Picture, SrgbRgb};
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::WorkFolder;
use mateval_scene::{Progress, Report, SceneError, json};

use super::delit_photo::DelitPhoto;
use super::lights_file::{LIGHTS_FORMAT, LightsFile};
use super::options::DelightOptions;
use super::page;
use super::rounds::delight;
use crate::error::BaselineError;
use crate::geometry::SceneGeometry;
use crate::submission::check_new_place;

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
    let mut scenes = Vec::new();
    for (at, scene) in dataset.scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, dataset.scenes.len()));
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let delit = delight(&geometry, options, progress)?;
        let folder = work.path().join(scene.id.as_str());
        std::fs::create_dir_all(&folder).map_err(SceneError::io("make", &folder))?;
        write_pictures(&folder, &delit, scene.exposure as f32)?;
        let shown = page::Shown { id: scene.id.to_string(), lights: delit.lights.clone(), rounds: delit.rounds };
        let lights = LightsFile { format: LIGHTS_FORMAT.to_owned(), candidates: options.lights, lights: delit.lights };
        json::write(&folder.join("lights.json"), &lights)?;
        scenes.push(shown);
    }
    let index = work.path().join("index.html");
    std::fs::write(&index, page::html(&scenes)).map_err(SceneError::io("write", &index))?;
    work.finish()?;
    Ok(scenes.len())
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
pub(super) fn exposed(picture: &Picture<LinearRgb>, exposure: f32) -> Picture<SrgbRgb> {
    picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (v * exposure).clamp(0.0, 1.0)))).to_srgb()
}
