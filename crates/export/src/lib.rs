//! Writes a dataset in formats that other tools read.
//!
//! In: a dataset whose files are those that its manifest lists. Out: a folder in one of five formats ([`Format`]).
//!
//! [`export`] opens and checks the dataset, lists its views with their pictures and licences ([`dataset`]), and passes
//! them to the format's own file: [`mod@tars`], [`croissant`] (which describes those tars), [`huggingface`], or
//! [`cameras`] (COLMAP and nerfstudio). [`mitsuba`] writes one view as a scene for Mitsuba 3, and [`codabench`] a
//! competition, which holds the truth.

pub mod cameras;
pub mod codabench;
pub mod croissant;
pub mod dataset;
pub mod huggingface;
pub mod mitsuba;
pub mod tars;

use std::path::{Path, PathBuf};

use mateval_dataset::open::check_outside;
use mateval_dataset::{Progress, Report};
use mateval_files::work_folder::WorkFolder;

pub use dataset::{ExportError, Exported, Format};
use dataset::{ShownView, SoundDataset, shown_views, write_licence};

/// What to export, and where to.
#[derive(Clone, Debug)]
pub struct ExportOptions {
    pub dataset: PathBuf,
    pub format: Format,
    pub out: PathBuf,
    /// Facts that the dataset does not hold and a description may state.
    pub publication: croissant::Publication,
}

/// Exports the dataset. Fails before anything is written where the output exists or lies in the dataset, where a file
/// of the dataset is missing, changed, hidden or not listed in its manifest, where the format needs scenes that are
/// absent, or pictures that were not rendered.
pub fn export(options: &ExportOptions, progress: Progress<'_>) -> Result<Exported, ExportError> {
    if options.out.exists() {
        return Err(ExportError::Exists { path: options.out.clone() });
    }
    check_outside(&options.out, &options.dataset, "--out")?;
    let sound = SoundDataset::open(&options.dataset, options.format, progress)?;
    let work = WorkFolder::start(&options.out)?;
    let exported = match options.format {
        Format::Tar => tars::export(&sound, work.path(), progress)?,
        Format::Croissant => croissant::export(&sound, &options.publication, work.path(), progress)?,
        Format::Huggingface => huggingface::export(&sound, work.path(), progress)?,
        Format::Nerfstudio => scene_by_scene(&sound, work.path(), progress, cameras::write_nerfstudio)?,
        Format::Colmap => scene_by_scene(&sound, work.path(), progress, cameras::write_colmap)?,
    };
    work.finish()?;
    Ok(exported)
}

/// Writes a folder for each scene with its licence and whatever `write` adds.
fn scene_by_scene(
    sound: &SoundDataset,
    out: &Path,
    progress: Progress<'_>,
    write: impl Fn(&SoundDataset, &[ShownView<'_>], &Path) -> Result<(), ExportError>,
) -> Result<Exported, ExportError> {
    let scenes = &sound.dataset.scenes;
    let mut exported = Exported { scenes: scenes.len(), views: Some(0), without_picture: 0 };
    for (at, scene) in scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, scenes.len()));
        let views = shown_views(&sound.dataset, scene);
        exported.without_picture += scene.views.len() - views.len();
        exported.views = exported.views.map(|sum| sum + views.len());
        let folder = out.join(scene.id.as_str());
        write(sound, &views, &folder)?;
        write_licence(&sound.dataset, &scene.id, &folder.join("LICENCE.txt"))?;
    }
    Ok(exported)
}
