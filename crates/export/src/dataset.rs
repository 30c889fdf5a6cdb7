//! What every format shares: the files that a dataset's manifest lists, the views that have pictures, the scenes'
//! licences, and how an export ends.

use std::path::{Path, PathBuf};

use glam::DVec3;
use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::{INPUT, MANIFEST};
use mateval_dataset::manifest::{self, Entry, is_withheld};
use mateval_dataset::open::{Dataset, is_below};
use mateval_dataset::{Camera, DatasetError, Progress, Report, SceneId, ViewId};
use mateval_files::FileError;
use mateval_files::whole::write_whole;
use mateval_files::work_folder::make_folder;

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
    pub scenes: usize,
    /// Number of views that are described; `None` for tars, which hold whole scenes.
    pub views: Option<usize>,
    /// Number of views that were left out, or described without a picture, because their pictures are withheld or were
    /// not rendered, as those of twins and of captured rooms.
    pub without_picture: usize,
}

/// Why a dataset could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The output exists; what it holds is not looked into, so it is never replaced.
    #[error("'{}' already exists; choose another --out, or remove it", path.display())]
    Exists { path: PathBuf },
    #[error(transparent)]
    Files(#[from] FileError),
    /// The manifest lists hidden files, which are not exported, and without which the copy would not be the dataset.
    #[error(
        "'{}' lists {} hidden files ('{}' first), which are never exported: remove them and make the dataset again",
        path.display(), files.len(), files[0]
    )]
    HiddenFiles {
        path: PathBuf,
        /// The files, relative to the dataset; at least one.
        files: Vec<String>,
    },
    /// The dataset's pictures were not rendered.
    #[error("'{}' has no pictures of all its views yet; run `mateval prep render DATASET`", path.display())]
    NoPictures { path: PathBuf },
    #[error(
        "a scene takes {seconds} s, and a task may take {limit} s; give a longer --limit, which needs an own queue"
    )]
    SceneOverLimit { seconds: u32, limit: u32 },
    #[error(
        "'{}': the scene '{scene}' has a flash, which moves with the camera, and the format states no lights: photos \
         of one place would contradict each other; export it as tar, which holds scene.json",
        path.display()
    )]
    Flash { path: PathBuf, scene: SceneId },
    /// The scene has no such view.
    #[error("'{}' has no view '{view}' of the scene '{scene}'", path.display())]
    NoView {
        path: PathBuf,
        scene: SceneId,
        /// The view that it does not have.
        view: ViewId,
    },
    /// The Parquet file could not be written.
    #[error("cannot write '{}': {source}", path.display())]
    Parquet { path: PathBuf, source: parquet::errors::ParquetError },
    /// The dataset is not valid, or lacks scenes that the format needs, or the output could not be written.
    #[error(transparent)]
    Dataset(#[from] mateval_dataset::DatasetError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

/// A dataset that may be exported.
#[derive(Clone, Debug)]
pub struct SoundDataset {
    pub dataset: Dataset,
    /// The files that the manifest lists and that exist: all but those of absent scenes and of withheld ground truth.
    /// Sorted; none is hidden and none lies outside the dataset.
    pub files: Vec<String>,
}

impl SoundDataset {
    /// Opens the dataset in `root` and hashes its files. Fails where one is changed, missing, hidden or not listed, or
    /// where the format needs scenes or pictures that do not exist.
    pub fn open(root: &Path, format: Format, progress: Progress<'_>) -> Result<Self, ExportError> {
        let dataset = Dataset::open(root)?.with_twins();
        if format.needs_all_scenes() {
            dataset.check_whole()?;
        } else if let Some(absence) = dataset.absence() {
            progress(Report::Message(&absence));
        }
        let is_of_cameras = matches!(format, Format::Nerfstudio | Format::Colmap);
        if let Some(scene) = dataset.scenes.iter().find(|scene| is_of_cameras && scene.flash.is_some()) {
            return Err(ExportError::Flash { path: root.to_owned(), scene: scene.id.clone() });
        }
        let has_photo = |scene: &SceneFile| scene.photo.is_some() || dataset.file.twins.contains_key(&scene.id);
        let is_rendered = |scene: &SceneFile| has_photo(scene) || dataset.photo_renderer(scene).is_some();
        if format.needs_pictures() && !dataset.scenes.iter().all(is_rendered) {
            return Err(ExportError::NoPictures { path: root.to_owned() });
        }
        progress(Report::step("hashes", 0, 1));
        let mut findings = manifest::check_those(root, |file| !is_below(file, &dataset.absent))?;
        findings.retain(|finding| !is_withheld(root, finding));
        if !findings.is_empty() {
            return Err(DatasetError::Invalid { path: root.to_owned(), findings }.into());
        }
        let listed = manifest::entries(root)?.into_iter().map(|Entry { file, .. }| file);
        let files: Vec<String> = listed.filter(|file| root.join(file).exists()).collect();
        let hidden: Vec<String> = files.iter().filter(|file| is_hidden(file)).cloned().collect();
        if hidden.is_empty() {
            return Ok(Self { dataset, files });
        }
        Err(ExportError::HiddenFiles { path: root.join(MANIFEST), files: hidden })
    }
}

/// Whether a file, or a folder on the way to it, is hidden.
fn is_hidden(file: &str) -> bool {
    file.split('/').any(|name| name.starts_with('.'))
}

/// A view that has a picture.
#[derive(Clone, Debug)]
pub struct ShownView<'a> {
    pub scene: &'a SceneFile,
    pub view: &'a View,
    /// Its 8-bit sRGB picture, relative to the dataset.
    pub picture: PathBuf,
}

/// The 8-bit sRGB picture of a view, relative to the dataset: that of the input view, or the reference picture of
/// another view. None where it does not exist, as with withheld ground truth.
pub fn picture(dataset: &Dataset, scene: &SceneFile, view: &View) -> Option<PathBuf> {
    let folder = dataset.folder(&scene.id);
    let file = match (view.id.as_str(), dataset.photo_renderer(scene)) {
        (INPUT, _) => folder.view(&view.id),
        (_, Some(renderer)) => folder.render(renderer, &view.id),
        (_, None) => return None,
    }
    .join("rgb.png");
    let relative = file.strip_prefix(&dataset.root).expect("a scene's files lie in the dataset").to_owned();
    file.is_file().then_some(relative)
}

/// The views of a scene that have a picture, in its order.
pub fn shown_views<'a>(dataset: &Dataset, scene: &'a SceneFile) -> Vec<ShownView<'a>> {
    let shown = |view: &'a View| Some(ShownView { scene, view, picture: picture(dataset, scene, view)? });
    scene.views.iter().filter_map(shown).collect()
}

/// The view's camera in the space of the scene's source, from which a dataset may have subtracted whole metres.
pub(crate) fn in_source(shown: &ShownView<'_>) -> Camera {
    let shift = DVec3::from(shown.scene.source.shift_m);
    if shift == DVec3::ZERO { shown.view.camera } else { shown.view.camera.moved(shift) }
}

/// The licence texts of a scene, each after the name of its file in the source; none where the dataset states none.
pub fn licence_text(dataset: &Dataset, scene: &SceneId) -> Option<String> {
    let own = dataset.file.licences.iter().filter(|licence| licence.scene == *scene);
    let texts: Vec<String> = own.map(|licence| format!("{}:\n\n{}\n", licence.file, licence.text.trim_end())).collect();
    (!texts.is_empty()).then(|| texts.join("\n"))
}

/// Writes the licence of a scene to `path`; writes nothing where the dataset states none.
pub fn write_licence(dataset: &Dataset, scene: &SceneId, path: &Path) -> Result<(), ExportError> {
    licence_text(dataset, scene).map_or(Ok(()), |text| write_file(path, text.as_bytes()))
}

/// Writes `licences/<scene>.txt` for every scene that has a licence.
pub fn write_licences(dataset: &Dataset, out: &Path) -> Result<(), ExportError> {
    let place = |scene: &SceneId| out.join("licences").join(format!("{scene}.txt"));
    dataset.file.scenes.iter().try_for_each(|scene| write_licence(dataset, scene, &place(scene)))
}

/// Markdown and HTML of a name are shown, not obeyed.
pub(crate) fn inert(text: &str) -> String {
    let plain: String = text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
    plain.replace('&', "&amp;").replace('<', "&lt;").replace(['`', '[', ']', '*', '_'], " ")
}

pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    make_folder_of(path)?;
    Ok(write_whole(path, bytes)?)
}

pub(crate) fn copy_file(from: &Path, to: &Path) -> Result<(), ExportError> {
    make_folder_of(to)?;
    std::fs::copy(from, to).map_err(FileError::io("copy", from))?;
    Ok(())
}

/// Makes the folder that `path` lies in.
pub(crate) fn make_folder_of(path: &Path) -> Result<(), ExportError> {
    let folder = path.parent().expect("an export writes below its own folder");
    Ok(make_folder(folder)?)
}
