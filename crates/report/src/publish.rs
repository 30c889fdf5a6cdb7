//! Splits a dataset into two folders: the files that everybody may see, and the ground truth that a hidden split
//! withholds.
//!
//! The public folder keeps the whole manifest. It therefore has the same identity as the dataset, and lists the hash of
//! every withheld file. Copied over the public folder, the private one restores the dataset.

use std::path::Path;

use mateval_dataset::dataset::{DatasetFile, FORMAT};
use mateval_dataset::layout::{COMPARE, DATASET, MANIFEST, is_ground_truth};
use mateval_dataset::manifest::{self, Entry};
use mateval_dataset::open::check_whole;
use mateval_dataset::{DatasetError, Progress, Report, json};
use mateval_files::FileError;
use mateval_files::untrusted::sha256_of_bytes;
use mateval_files::work_folder::{WorkFolder, check_holds_none};

use crate::error::ReportError;

/// The result of publishing a dataset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Published {
    /// SHA-256, in hexadecimal, of the manifest's lines of the withheld files, each with its newline. Whoever has the
    /// public folder can compute it too, and check the private folder against the manifest once that is published.
    pub commitment_sha256: String,
    /// Number of files in the public folder.
    pub public_files: usize,
    /// Number of files in the private folder.
    pub private_files: usize,
}

/// Writes the public files of the dataset in `root` to `public` and its ground truth to `private`; both are replaced
/// where they exist. Fails before anything is written where a file differs from the manifest or there is no ground
/// truth.
pub fn publish(root: &Path, public: &Path, private: &Path, progress: Progress<'_>) -> Result<Published, ReportError> {
    let dataset: DatasetFile = json::read_format(&root.join(DATASET), FORMAT)?;
    check_whole(root, &dataset)?;
    [public, private].into_iter().try_for_each(|out| check_holds_none(out, &[root]))?;
    progress(Report::step("hashes", 0, 1));
    let findings = manifest::check(root)?;
    if !findings.is_empty() {
        return Err(DatasetError::Invalid { path: root.to_owned(), findings }.into());
    }
    let (withheld, shown) = split(root)?;
    if withheld.is_empty() {
        return Err(ReportError::NoGroundTruth { path: root.to_owned() });
    }
    let commitment_sha256 = commitment_of(&withheld);
    let mut shown: Vec<&str> = shown.iter().map(|entry| entry.file.as_str()).collect();
    shown.extend([MANIFEST, DATASET]);
    shown.extend(root.join(COMPARE).is_file().then_some(COMPARE));
    let withheld: Vec<&str> = withheld.iter().map(|entry| entry.file.as_str()).collect();
    let folders = [(public, &shown, "public folder"), (private, &withheld, "private folder")];
    let mut works = Vec::new();
    for (place, files, what) in folders {
        let work = WorkFolder::start(place)?;
        copy(root, work.path(), files, &|done| progress(Report::step(what, done, files.len())))?;
        works.push(work);
    }
    works.into_iter().try_for_each(WorkFolder::finish)?;
    Ok(Published { commitment_sha256, public_files: shown.len(), private_files: withheld.len() })
}

/// The commitment to the ground truth of the dataset in `root`, from its manifest alone:
/// [`Published::commitment_sha256`].
pub fn commitment(root: &Path) -> Result<String, ReportError> {
    Ok(commitment_of(&split(root)?.0))
}

/// The manifest's files: the ground truth, then all others.
fn split(root: &Path) -> Result<(Vec<Entry>, Vec<Entry>), ReportError> {
    Ok(manifest::entries(root)?.into_iter().partition(|entry| is_ground_truth(&entry.file)))
}

fn commitment_of(withheld: &[Entry]) -> String {
    let lines: String = withheld.iter().map(|entry| format!("{}  {}\n", entry.sha256, entry.file)).collect();
    sha256_of_bytes(lines.as_bytes())
}

fn copy(from: &Path, to: &Path, files: &[&str], progress: &dyn Fn(usize)) -> Result<(), ReportError> {
    for (done, file) in files.iter().enumerate() {
        progress(done);
        let place = to.join(file);
        if let Some(folder) = place.parent() {
            std::fs::create_dir_all(folder).map_err(FileError::io("make", folder))?;
        }
        std::fs::copy(from.join(file), &place).map_err(FileError::io("write", &place))?;
    }
    Ok(())
}
