//! The files of `mateval baseline relight`.

use std::collections::BTreeSet;
use std::path::Path;

use mateval_image::exr_io::{Precision, write_linear};
use mateval_image::png_io::write_srgb;
use mateval_scene::dataset::SceneFile;
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::WorkFolder;
use mateval_scene::{Progress, Report, SceneError};

use super::super::files::exposed;
use super::super::lights_file::LightsFile;
use super::super::part_room::PartRoom;
use super::delit_pictures::{DelitPictures, read_lights};
use super::page::{ScaledPicture, Shown, Slider, html};
use super::relit_photo::{RelitPhoto, relight};
use crate::error::BaselineError;
use crate::geometry::SceneGeometry;
use crate::submission::check_new_place;

/// A light that shines more or less than it was fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Dimmed {
    /// Its name in `lights.json`.
    pub name: String,
    /// The factor of its radiance, 0 or more.
    pub factor: f64,
}

/// How rooms are lit.
#[derive(Clone, Debug, PartialEq)]
pub struct RelightOptions {
    /// The lights that are dimmed; of two entries of one name, the last one counts.
    pub dimmed: Vec<Dimmed>,
    /// Paths per pixel, in two halves: an odd number is rounded down.
    pub samples: u32,
}

impl Default for RelightOptions {
    fn default() -> Self {
        Self { dimmed: Vec::new(), samples: 64 }
    }
}

/// Lights every scene whose folder exists in `pictures`, the output of [`super::super::write`]. `out` receives
/// `index.html` and for each scene `relit.exr`, the same as PNG, and `photo.png`. Returns the number of scenes.
///
/// Fails where `pictures` holds no scene of the dataset, or where no scene has a light of a name in `options`.
pub fn write(
    dataset: &Dataset,
    pictures: &Path,
    out: &Path,
    options: &RelightOptions,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    check_new_place(dataset, out)?;
    let scenes = scenes(dataset, pictures)?;
    check_names(pictures, &scenes, &options.dimmed)?;
    let work = WorkFolder::start(out)?;
    let mut shown = Vec::new();
    let count = scenes.len();
    for (at, (scene, lights)) in scenes.into_iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, count));
        let delit = DelitPictures::read(&pictures.join(scene.id.as_str()), lights)?;
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let room = PartRoom::read(&geometry, delit.lights.candidates)?;
        let factors: Vec<f64> = delit.lights.names().map(|name| factor(&options.dimmed, name)).collect();
        let relit = relight(&room, &delit, &factors, options.samples, progress)?;
        let folder = work.path().join(scene.id.as_str());
        std::fs::create_dir_all(&folder).map_err(SceneError::io("make", &folder))?;
        let exposure = scene.exposure as f32;
        write_linear(&folder.join("relit.exr"), &relit.whole, Precision::Float)?;
        write_srgb(&folder.join("relit.png"), &exposed(&relit.whole, exposure))?;
        write_srgb(&folder.join("photo.png"), &exposed(&room.photo, exposure))?;
        shown.push(section(scene, &relit, &delit, &factors));
    }
    let index = work.path().join("index.html");
    std::fs::write(&index, html(&shown)).map_err(SceneError::io("write", &index))?;
    work.finish()?;
    Ok(shown.len())
}

/// The scenes of the dataset that were de-lit, with their lights.
fn scenes<'a>(dataset: &'a Dataset, pictures: &Path) -> Result<Vec<(&'a SceneFile, LightsFile)>, BaselineError> {
    let folder = |scene: &SceneFile| pictures.join(scene.id.as_str());
    let delit = dataset.scenes.iter().filter(|scene| folder(scene).is_dir());
    let scenes: Vec<_> =
        delit.map(|scene| Ok((scene, read_lights(&folder(scene))?))).collect::<Result<_, BaselineError>>()?;
    if scenes.is_empty() { Err(BaselineError::NothingDelit(pictures.to_owned())) } else { Ok(scenes) }
}

fn check_names(pictures: &Path, scenes: &[(&SceneFile, LightsFile)], dimmed: &[Dimmed]) -> Result<(), BaselineError> {
    let known: BTreeSet<&str> = scenes.iter().flat_map(|(_, lights)| lights.names()).collect();
    let unknown: Vec<String> = dimmed
        .iter()
        .filter(|dimmed| !known.contains(dimmed.name.as_str()))
        .map(|dimmed| dimmed.name.clone())
        .collect();
    if unknown.is_empty() {
        return Ok(());
    }
    let known = known.into_iter().map(str::to_owned).collect();
    Err(BaselineError::NoLight { folder: pictures.to_owned(), unknown, known })
}

fn factor(dimmed: &[Dimmed], name: &str) -> f64 {
    dimmed.iter().rev().find(|dimmed| dimmed.name == name).map_or(1.0, |dimmed| dimmed.factor)
}

/// The scene on the page. Lights without a slider shine as their factors state.
fn section(scene: &SceneFile, relit: &RelitPhoto, delit: &DelitPictures, factors: &[f64]) -> Shown {
    let exposure = scene.exposure as f32;
    let sliders = relit.strongest.iter().map(|lit| Slider {
        light: delit.lights.lights[lit.light].light.clone(),
        factor: factors[lit.light],
        picture: ScaledPicture::new(&lit.picture, exposure),
    });
    Shown {
        id: scene.id.to_string(),
        size: [relit.whole.width(), relit.whole.height()],
        lights: sliders.collect(),
        rest: ScaledPicture::new(&relit.rest, exposure),
    }
}
