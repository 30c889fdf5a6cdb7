//! The files of `mateval baseline delight`: pictures, `lights.json`, and a page with what was found in each photo.

use std::fmt::Write as _;
use std::path::Path;

use mateval_dataset::open::Dataset;
use mateval_dataset::{Progress, Report, json};
use mateval_files::FileError;
use mateval_files::work_folder::WorkFolder;
use mateval_image::exr_io::{Precision, write_grey, write_linear};
use mateval_image::png_io::{write_grey_bytes, write_srgb};
use mateval_image::{LinearRgb, Picture, SrgbRgb};
use mateval_pages::{figure, plain};
use serde::{Deserialize, Serialize};

use super::room::FittedLight;
use super::{CandidateLights, DelightOptions, DelitPhoto, delight};
use crate::error::BaselineError;
use crate::geometry::SceneGeometry;
use crate::submission::check_new_place;

pub(super) const LIGHTS_FORMAT: &str = "mateval-fitted-lights/2";

/// The fitted lights of a scene.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct LightsFile {
    /// [`LIGHTS_FORMAT`].
    pub(super) format: String,
    /// Which lights were given the chance to shine.
    pub(super) candidates: CandidateLights,
    /// Candidates of the room first, then the lights of the stage.
    pub(super) lights: Vec<FittedLight>,
}

impl LightsFile {
    /// The names of the lights.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.lights.iter().map(|fitted| fitted.light.name.as_str())
    }
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
    let mut scenes = Vec::new();
    for (at, scene) in dataset.scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, dataset.scenes.len()));
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let delit = delight(&geometry, options, progress)?;
        let folder = work.path().join(scene.id.as_str());
        std::fs::create_dir_all(&folder).map_err(FileError::io("make", &folder))?;
        write_pictures(&folder, &delit, scene.exposure as f32)?;
        let shown = Shown { id: scene.id.to_string(), lights: delit.lights.clone(), rounds: delit.rounds };
        let lights = LightsFile { format: LIGHTS_FORMAT.to_owned(), candidates: options.lights, lights: delit.lights };
        json::write(&folder.join("lights.json"), &lights)?;
        scenes.push(shown);
    }
    let index = work.path().join("index.html");
    std::fs::write(&index, html(&scenes)).map_err(FileError::io("write", &index))?;
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

/// A scene on the page.
pub(super) struct Shown {
    pub(super) id: String,
    pub(super) lights: Vec<FittedLight>,
    pub(super) rounds: usize,
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

/// The page. Ids and names of lights contain no characters that are special in HTML.
pub(super) fn html(scenes: &[Shown]) -> String {
    let introduction = "A photo is base colour times the light on a white surface, plus light that does not depend on \
                        base colour. <code>mateval baseline relight</code> lights the rooms anew.";
    plain("De-lit photos", introduction, &scenes.iter().map(section).collect::<String>(), "")
}

fn section(Shown { id, lights, rounds }: &Shown) -> String {
    let mut text = format!("<section><h2>{id}</h2><div class=\"row\">\n");
    text.extend(PICTURES.map(|(file, caption)| figure(&format!("{id}/{file}.png"), id, caption)));
    let count = lights.len();
    text.push_str("</div><details><summary>");
    write!(text, "{count} lights after {rounds} rounds").expect("writing to a String cannot fail");
    text.push_str(
        "</summary><div class=\"wide\"><table><thead><tr><th>Light</th><th>Red</th><th>Green</th><th>Blue</th></tr></thead><tbody>\n",
    );
    text.extend(lights.iter().map(|FittedLight { light, radiance: [r, g, b] }| {
        format!("<tr><th scope=\"row\">{}</th><td>{r:.4}</td><td>{g:.4}</td><td>{b:.4}</td></tr>\n", light.name)
    }));
    text.push_str("</tbody></table></div></details></section>\n");
    text
}
