//! Writes a dataset in formats that other tools read.
//!
//! In: a dataset whose files are those that its manifest lists. Out: a folder in one of five formats ([`Format`]).
//!
//! [`export`] opens and checks the dataset, lists its views with their pictures and licences ([`dataset`]), and passes
//! them to the format's own file: [`mod@tars`], [`croissant`] (which describes those tars), [`huggingface`], or
//! [`cameras`] (COLMAP and nerfstudio).

pub mod cameras;
pub mod croissant;
pub mod dataset;
pub mod huggingface;
pub mod tars;

use std::path::{Path, PathBuf};

use mateval_scene::work_folder::{WorkFolder, is_inside};
use mateval_scene::{Progress, Report};

use dataset::{ShownView, SoundDataset, shown_views, write_licence};

/// What to export, and where to.
#[derive(Clone, Debug)]
pub struct ExportOptions {
    /// The dataset's folder.
    pub dataset: PathBuf,
    /// The format.
    pub format: Format,
    /// The folder to write.
    pub out: PathBuf,
    /// Facts that the dataset does not hold and a description may state.
    pub publication: croissant::Publication,
}

/// A format that a dataset can be written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// One tar a scene and one for the rest, so that scenes can be downloaded on their own.
    Tar,
    /// The same tars with a description of them and of every view, in Croissant's JSON-LD.
    Croissant,
    /// A Parquet file with a row a view, and a dataset card.
    Huggingface,
    /// A folder a scene with `transforms.json`.
    Nerfstudio,
    /// A folder a scene with COLMAP's text model.
    Colmap,
}

impl Format {
    /// Whether the export is the whole dataset, so that no scene may be absent.
    pub fn needs_all_scenes(self) -> bool {
        matches!(self, Self::Tar | Self::Croissant | Self::Huggingface)
    }

    /// Whether the export shows the views' pictures, so that they must have been rendered.
    pub fn needs_pictures(self) -> bool {
        self != Self::Tar
    }
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exported {
    /// Number of scenes.
    pub scenes: usize,
    /// Number of views that are described; `None` for tars, which hold whole scenes.
    pub views: Option<usize>,
    /// Number of views that were left out, or described without a picture, because their pictures are withheld.
    pub without_picture: usize,
}

/// Why a dataset could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The output exists; what it holds is not looked into, so it is never replaced.
    #[error("'{}' already exists; choose another --out, or remove it", path.display())]
    Exists {
        /// The output.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was attempted, as in "read" or "write".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The manifest lists hidden files, which are not exported, and without which the copy would not be the dataset.
    #[error(
        "'{}' lists {} hidden files ('{}' first), which are never exported: remove them and make the dataset again",
        path.display(), files.len(), files[0]
    )]
    HiddenFiles {
        /// The manifest.
        path: PathBuf,
        /// The files, relative to the dataset; at least one.
        files: Vec<String>,
    },
    /// The dataset's pictures were not rendered.
    #[error("'{}' has no pictures of all its views yet; run `mateval prep render DATASET`", path.display())]
    NoPictures {
        /// The dataset.
        path: PathBuf,
    },
    /// The output would lie in the dataset.
    #[error("'{}' would lie in the dataset, whose manifest does not list it; choose another --out", path.display())]
    OutputInDataset {
        /// The output.
        path: PathBuf,
    },
    /// The Parquet file could not be written.
    #[error("cannot write '{}': {source}", path.display())]
    Parquet {
        /// The file.
        path: PathBuf,
        /// The writer's error.
        source: parquet::errors::ParquetError,
    },
    /// The dataset is not valid, or lacks scenes that the format needs, or the output could not be written.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl ExportError {
    /// A constructor of [`ExportError::Io`] for `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}

/// Exports the dataset. Fails before anything is written where the output exists or lies in the dataset, where a file of
/// the dataset is missing, changed, hidden or not listed in its manifest, where the format needs scenes that are absent,
/// or pictures that were not rendered.
pub fn export(options: &ExportOptions, progress: Progress<'_>) -> Result<Exported, ExportError> {
    if options.out.exists() {
        return Err(ExportError::Exists { path: options.out.clone() });
    }
    if is_inside(&options.out, &options.dataset) {
        return Err(ExportError::OutputInDataset { path: options.out.clone() });
    }
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
