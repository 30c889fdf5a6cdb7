//! A dataset whose files were compared with its manifest.

use std::path::Path;

use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::MANIFEST;
use mateval_scene::manifest::{self, Entry, MISSING_FILE};
use mateval_scene::open::{Dataset, is_below};
use mateval_scene::{Finding, Progress, Report, SceneError};

use crate::error::ExportError;
use crate::format::Format;

/// A dataset that may be exported.
#[derive(Clone, Debug)]
pub struct SoundDataset {
    /// The dataset.
    pub dataset: Dataset,
    /// The files that the manifest lists and that exist: all but those of absent scenes and of withheld ground truth.
    /// Sorted; none is hidden and none lies outside the dataset.
    pub files: Vec<String>,
}

impl SoundDataset {
    /// Opens the dataset in `root` and hashes its files. Fails where one is changed, missing, hidden or not listed, or
    /// where the format needs scenes or pictures that do not exist.
    pub fn open(root: &Path, format: Format, progress: Progress<'_>) -> Result<Self, ExportError> {
        let dataset = Dataset::open(root)?;
        if format.needs_all_scenes() {
            dataset.check_whole()?;
        } else if let Some(absence) = dataset.absence() {
            progress(Report::Message(&absence));
        }
        let is_rendered = |scene: &SceneFile| scene.photo.is_some() || dataset.photo_renderer(scene).is_some();
        if format.needs_pictures() && !dataset.scenes.iter().all(is_rendered) {
            return Err(ExportError::NoPictures { path: root.to_owned() });
        }
        progress(Report::step("hashes", 0, 1));
        let mut findings = manifest::check_those(root, |file| !is_below(file, &dataset.absent))?;
        findings.retain(|finding| !is_withheld(root, finding));
        if !findings.is_empty() {
            return Err(SceneError::Invalid { path: root.to_owned(), findings }.into());
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

/// Whether a file is missing because the whole ground truth of its scene is withheld.
fn is_withheld(root: &Path, finding: &Finding) -> bool {
    let folder = finding.file.split_once("/ground_truth/").map(|(scene, _)| root.join(scene).join("ground_truth"));
    finding.code == MISSING_FILE && folder.is_some_and(|folder| !folder.exists())
}

/// Whether a file, or a folder on the way to it, is hidden.
fn is_hidden(file: &str) -> bool {
    file.split('/').any(|name| name.starts_with('.'))
}
