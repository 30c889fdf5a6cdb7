//! A dataset in two trees: what everybody may see, and the ground truth that a hidden split withholds.
//!
//! Both are of one dataset: the public tree keeps the whole manifest, so that its identity is the same, and with it the
//! hash of every file that is withheld. Laid over the public tree the private one gives the dataset again.

use std::path::Path;

use mateval_scene::layout::{DATASET, MANIFEST};
use mateval_scene::manifest::{self, Entry, sha256_of_bytes};
use mateval_scene::work_folder::WorkFolder;
use mateval_scene::{Progress, SceneError};

use crate::error::AuditError;

/// What was published.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Published {
    /// SHA-256, hex, of the manifest's lines of the withheld files, each with its newline: anyone who has the public tree
    /// can hash them too, and hold the private tree against them when it is shown.
    pub commitment_sha256: String,
    /// Files of the public tree.
    pub public_files: usize,
    /// Files of the private tree.
    pub private_files: usize,
}

/// Writes the dataset in `root` to `public` and its ground truth to `private`; what is in their places is replaced. Fails,
/// before anything is written, where a file is not what the manifest says, or where there is no ground truth.
pub fn publish(root: &Path, public: &Path, private: &Path, progress: Progress<'_>) -> Result<Published, AuditError> {
    progress("hashes", 0, 1);
    let findings = manifest::check(root)?;
    if !findings.is_empty() {
        return Err(SceneError::Invalid { path: root.to_owned(), findings }.into());
    }
    let (withheld, shown): (Vec<Entry>, Vec<Entry>) =
        manifest::entries(root)?.into_iter().partition(|entry| is_ground_truth(&entry.file));
    if withheld.is_empty() {
        let what = "has no ground truth to withhold".to_owned();
        return Err(AuditError::Output { path: root.to_owned(), what });
    }
    let lines: String = withheld.iter().map(|entry| format!("{}  {}\n", entry.sha256, entry.file)).collect();
    let mut shown: Vec<&str> = shown.iter().map(|entry| entry.file.as_str()).collect();
    shown.extend([MANIFEST, DATASET]);
    let withheld: Vec<&str> = withheld.iter().map(|entry| entry.file.as_str()).collect();
    let trees = [(public, &shown, "public tree"), (private, &withheld, "private tree")];
    let mut works = Vec::new();
    for (place, files, what) in trees {
        let work = WorkFolder::start(place)?;
        copy(root, work.path(), files, &|done| progress(what, done, files.len()))?;
        works.push(work);
    }
    works.into_iter().try_for_each(WorkFolder::finish)?;
    Ok(Published {
        commitment_sha256: sha256_of_bytes(lines.as_bytes()),
        public_files: shown.len(),
        private_files: withheld.len(),
    })
}

/// Whether it is `scenes/<scene>/ground_truth/...`.
fn is_ground_truth(file: &str) -> bool {
    let mut parts = file.split('/');
    parts.next() == Some("scenes") && parts.nth(1) == Some("ground_truth")
}

fn copy(from: &Path, to: &Path, files: &[&str], progress: &dyn Fn(usize)) -> Result<(), AuditError> {
    for (done, file) in files.iter().enumerate() {
        progress(done);
        let place = to.join(file);
        if let Some(folder) = place.parent() {
            std::fs::create_dir_all(folder).map_err(AuditError::io("make", folder))?;
        }
        std::fs::copy(from.join(file), &place).map_err(AuditError::io("write", &place))?;
    }
    Ok(())
}
