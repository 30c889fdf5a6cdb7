//! Splits a dataset into two folders: the files that everybody may see, and those that a hidden split withholds.
//!
//! Withheld are the ground truth and everything from which it could be made again: the recipe, the hashes of the
//! source's files, and findings about them. The public manifest has a commitment in place of their hashes
//! (`mateval_dataset::withheld`). Copied over the public folder, the private one gives a whole dataset of the same
//! identity, with the truth and with the public folder's own `scene.json`.

use std::path::Path;

use mateval_dataset::dataset::{DatasetFile, SceneFile, Secrecy};
use mateval_dataset::layout::{COMPARE, DATASET, MANIFEST, SceneFolder, WHOLE_SCENE, is_ground_truth};
use mateval_dataset::manifest::{self, Entry, lines, public_lines};
use mateval_dataset::open::Dataset;
use mateval_dataset::verdict::VerdictFile;
use mateval_dataset::withheld::{SECRET, Secret, WITHHELD};
use mateval_dataset::{DatasetError, Progress, Report, SceneId, json};
use mateval_files::FileError;
use mateval_files::untrusted::{sha256_of_bytes, sha256_of_file};
use mateval_files::whole::{write_private, write_whole};
use mateval_files::work_folder::{WorkFolder, check_holds_none, make_folder};
use mateval_prep::recipe::RECIPE;

use crate::error::ReportError;

/// The result of publishing a dataset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Published {
    /// HMAC-SHA256, in hexadecimal, of the hashes of all withheld files, under the secret in the private folder.
    pub commitment: String,
    /// The identity of the split, which differs from that of the dataset that it was made from.
    pub manifest_sha256: String,
    pub secrecy: Secrecy,
    /// Number of files in the public folder.
    pub public_files: usize,
    /// Number of files in the private folder.
    pub private_files: usize,
}

/// The scenes whose truth follows from public files.
pub fn open_scenes(dataset: &Dataset) -> Vec<SceneId> {
    dataset.scenes.iter().filter(|scene| !scene.is_secret()).map(|scene| scene.id.clone()).collect()
}

/// Writes the public files of the dataset in `root` to `public` and the others to `private`; both are replaced where
/// they exist. Fails before anything is written where a file differs from the manifest, where there is no ground truth,
/// and where the truth of a scene follows from public files, unless `open_book`.
pub fn publish(
    root: &Path,
    public: &Path,
    private: &Path,
    open_book: bool,
    progress: Progress<'_>,
) -> Result<Published, ReportError> {
    // Refuse before anything is written. Twins have files to withhold, too.
    let dataset = Dataset::open(root)?.with_twins();
    dataset.check_whole()?;
    [public, private].into_iter().try_for_each(|out| check_holds_none(out, &[root]))?;
    let open = open_scenes(&dataset);
    let secrecy = if open.is_empty() { Secrecy::Secret } else { Secrecy::NotSecret };
    if secrecy == Secrecy::NotSecret && !open_book {
        return Err(ReportError::OpenBook { path: root.to_owned(), scenes: open });
    }
    progress(Report::step("hashes", 0, 1));
    let findings = manifest::check(root)?;
    if !findings.is_empty() {
        return Err(DatasetError::Invalid { path: root.to_owned(), findings }.into());
    }
    let is_withheld = |entry: &Entry| is_ground_truth(&entry.file) || entry.file == RECIPE;
    let (mut withheld, mut shown): (Vec<Entry>, Vec<Entry>) =
        manifest::entries(root)?.into_iter().partition(is_withheld);
    if !withheld.iter().any(|entry| is_ground_truth(&entry.file)) {
        return Err(ReportError::NoGroundTruth { path: root.to_owned() });
    }

    // The files as they are, and the whole `scene.json` among the withheld ones.
    let works = [WorkFolder::start(public)?, WorkFolder::start(private)?];
    let [out, hidden] = works.each_ref().map(WorkFolder::path);
    copy(root, out, &shown, &|done| progress(Report::step("public folder", done, shown.len())))?;
    copy(root, hidden, &withheld, &|done| progress(Report::step("private folder", done, withheld.len())))?;
    for scene in &dataset.scenes {
        let original = format!("scenes/{}/scene.json", scene.id);
        let place = format!("scenes/{}/{WHOLE_SCENE}", scene.id);
        let Some(entry) = shown.iter_mut().find(|entry| entry.file == original) else { continue };
        copy_file(root, &original, hidden, &place)?;
        withheld.push(Entry { sha256: entry.sha256.clone(), file: place });
        let path = SceneFolder::of(out, &scene.id).scene_file();
        json::write(&path, &without_origin(scene.clone()))?;
        entry.sha256 = sha256_of_file(&path)?;
    }

    // The lists and the commitment.
    withheld.sort_by(|a, b| a.file.cmp(&b.file));
    let secret = Secret::random()?;
    let list = lines(&withheld);
    let commitment = secret.commitment(list.as_bytes());
    write_private(&hidden.join(SECRET), &secret.file_bytes())?;
    write_whole(&hidden.join(WITHHELD), list.as_bytes())?;
    let text = public_lines(&shown, &withheld, &commitment);
    let manifest_sha256 = sha256_of_bytes(text.as_bytes());
    write_whole(&out.join(MANIFEST), text.as_bytes())?;
    let identity = dataset.file.manifest_sha256.clone();
    let file = DatasetFile { withheld: Some(secrecy), manifest_sha256: manifest_sha256.clone(), ..dataset.file };
    json::write(&out.join(DATASET), &file)?;
    let of_this = |verdict: &VerdictFile| verdict.manifest_sha256 == identity;
    if let Some(verdict) = VerdictFile::read_beside(root)?.filter(of_this) {
        let verdict = VerdictFile { manifest_sha256: manifest_sha256.clone(), ..verdict };
        json::write(&out.join(COMPARE), &verdict)?;
    }
    works.into_iter().try_for_each(WorkFolder::finish)?;
    Ok(Published {
        commitment,
        manifest_sha256,
        secrecy,
        public_files: shown.len() + 2,
        private_files: withheld.len() + 2,
    })
}

/// The scene without what leads to the files that it was made from. The file of a photo stays: it is public.
fn without_origin(mut scene: SceneFile) -> SceneFile {
    let photo = scene.photo.as_ref().map(|photo| photo.file.clone());
    scene.source.files.retain(|file| Some(&file.path) == photo.as_ref());
    scene.findings.clear();
    scene
}

fn copy(from: &Path, to: &Path, entries: &[Entry], progress: &dyn Fn(usize)) -> Result<(), ReportError> {
    for (done, Entry { file, .. }) in entries.iter().enumerate() {
        progress(done);
        copy_file(from, file, to, file)?;
    }
    Ok(())
}

fn copy_file(from: &Path, file: &str, to: &Path, name: &str) -> Result<(), ReportError> {
    let place = to.join(name);
    if let Some(folder) = place.parent() {
        make_folder(folder)?;
    }
    std::fs::copy(from.join(file), &place).map_err(FileError::io("write", &place))?;
    Ok(())
}
