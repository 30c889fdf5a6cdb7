//! The hashes of one scene's files, kept in `.build` so that the dataset's manifest is written without reading them again.

use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use mateval_image::store::write_whole;
use mateval_image::temporary::is_temporary;
use serde::{Deserialize, Serialize};

use crate::build_folder::BuildFolder;
use crate::layout::is_rendered;
use crate::manifest::{self, sha256_of_file};
use crate::{Finding, SceneError, SceneId, json};

/// The listed files of a scene.
#[derive(Debug)]
pub struct SceneHashes {
    root: PathBuf,
    scene: SceneId,
    files: BTreeMap<String, Listed>,
}

/// A file as it was when it was hashed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Listed {
    sha256: String,
    /// None where the hash was taken from the manifest and the file not read yet.
    stamp: Option<Stamp>,
}

/// Properties that differ after every change of a file: a program may set the time of a modification, but not that of
/// the last change of the file's entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Stamp {
    bytes: u64,
    modified: (i64, i64),
    changed: (i64, i64),
}

impl Stamp {
    fn of(path: &Path) -> Option<Self> {
        let found = std::fs::metadata(path).ok()?;
        let (modified, changed) = ((found.mtime(), found.mtime_nsec()), (found.ctime(), found.ctime_nsec()));
        Some(Self { bytes: found.len(), modified, changed })
    }
}

impl SceneHashes {
    /// The list of a scene. Of a scene that has not changed since the manifest was written, the manifest's hashes count.
    /// A list that cannot be read counts as missing.
    pub fn open(root: &Path, scene: &SceneId) -> Result<Self, SceneError> {
        let build = BuildFolder::of(root);
        let mut files: BTreeMap<String, Listed> = json::read(&build.hashes(scene)).unwrap_or_default();
        if root.join(crate::layout::MANIFEST).is_file() && !build.changed().contains(scene) {
            let folder = folder(scene);
            let listed = manifest::entries(root)?.into_iter().filter(|entry| entry.file.starts_with(&folder));
            let stamp = |file: &String, sha256: &String| {
                files.get(file).filter(|listed| listed.sha256 == *sha256).and_then(|listed| listed.stamp)
            };
            let listed = listed.map(|entry| {
                let stamp = stamp(&entry.file, &entry.sha256);
                (entry.file, Listed { sha256: entry.sha256, stamp })
            });
            let listed: BTreeMap<String, Listed> = listed.collect();
            // The manifest lists nothing of a scene that was left out.
            if !listed.is_empty() {
                files = listed;
            }
        }
        Ok(Self { root: root.to_owned(), scene: scene.clone(), files })
    }

    /// An empty list, for a scene that is made new.
    pub fn empty(root: &Path, scene: &SceneId) -> Self {
        Self { root: root.to_owned(), scene: scene.clone(), files: BTreeMap::new() }
    }

    /// Compares the files with the list: each one that is missing, changed or not listed is a finding. Only those are
    /// compared that `concerns` accepts by their paths in the dataset, and only those are read whose size or times are not
    /// those of the list.
    pub fn check(&mut self, concerns: impl Fn(&str) -> bool) -> Result<Vec<Finding>, SceneError> {
        let mut findings = Vec::new();
        for (file, listed) in self.files.iter_mut().filter(|(file, _)| concerns(file)) {
            let path = self.root.join(file);
            let stamp = Stamp::of(&path);
            if stamp.is_some() && stamp == listed.stamp {
                continue;
            }
            match sha256_of_file(&path) {
                Ok(found) if found == listed.sha256 => listed.stamp = stamp,
                Ok(found) => findings.push(manifest::changed_file(file, &found, &listed.sha256)),
                Err(_) if stamp.is_none() => findings.push(manifest::missing_file(file)),
                Err(error) => return Err(error),
            }
        }
        let unlisted = self.found()?.into_iter().filter(|file| concerns(file) && !self.files.contains_key(file));
        findings.extend(unlisted.map(|file| manifest::unlisted_file(&self.root, &file)));
        findings.sort();
        Ok(findings.into_iter().map(with_advice).collect())
    }

    /// Lists the files as they are now, after `prep` wrote them, and keeps the list. Only those are read whose size or
    /// times are not those of the list.
    pub fn update(&mut self) -> Result<(), SceneError> {
        let mut files = BTreeMap::new();
        for file in self.found()? {
            manifest::refuse_linked_folder(&self.root, &file)?;
            let path = self.root.join(&file);
            let stamp = Stamp::of(&path);
            let known = self.files.get(&file).filter(|listed| stamp.is_some() && listed.stamp == stamp);
            let listed = match known {
                Some(listed) => listed.clone(),
                None => Listed { sha256: sha256_of_file(&path)?, stamp },
            };
            files.insert(file, listed);
        }
        self.files = files;
        self.keep()
    }

    /// Keeps the list, and notes that it counts from here on, and not the manifest: the scene is about to change.
    pub fn note_change(&self) -> Result<(), SceneError> {
        self.keep()?;
        BuildFolder::of(&self.root).note_change(&self.scene)
    }

    fn keep(&self) -> Result<(), SceneError> {
        let list = BuildFolder::of(&self.root).hashes(&self.scene);
        let parent = list.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(parent).map_err(SceneError::io("make", parent))?;
        // Without line breaks: nobody reads it, and a room has hundreds of files.
        let text = serde_json::to_string(&self.files).expect("names, numbers and hashes become JSON");
        Ok(write_whole(&list, text.as_bytes())?)
    }

    /// Paths in the dataset and hashes, sorted by path.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &str)> {
        self.files.iter().map(|(file, listed)| (file.as_str(), listed.sha256.as_str()))
    }

    /// The scene's files but unfinished ones; those that a killed process left are removed.
    fn found(&self) -> Result<Vec<String>, SceneError> {
        manifest::remove_abandoned(&self.root.join(folder(&self.scene)))?;
        let files = manifest::list_below(&self.root, Path::new(&folder(&self.scene)))?;
        Ok(files.into_iter().filter(|file| !file.split('/').any(is_temporary)).collect())
    }
}

/// The finding with the command that helps.
fn with_advice(finding: Finding) -> Finding {
    let action = match (is_rendered(&finding.file), finding.file.contains("/renders/scorer/")) {
        (true, true) => {
            "run `prep render --only scorer` for this scene: it was cut off, or the file was changed by hand"
        }
        (true, false) => "run `prep render` again for this scene: it was cut off, or the file was changed by hand",
        (false, _) => "make the scene again by `prep build --scene SCENE --force`: the file was changed by hand",
    };
    Finding { action: action.to_owned(), ..finding }
}

fn folder(scene: &SceneId) -> String {
    format!("scenes/{scene}/")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene_with(files: &[(&str, &str)]) -> (tempfile::TempDir, SceneId) {
        let root = tempfile::tempdir().unwrap();
        for (file, text) in files {
            let path = root.path().join("scenes/room").join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        (root, SceneId::new("room").unwrap())
    }

    fn codes(found: Vec<Finding>) -> Vec<String> {
        found.into_iter().map(|finding| format!("{} {}", finding.code, finding.file)).collect()
    }

    #[test]
    fn changes_of_every_kind_are_found_and_nothing_else() {
        let (root, id) = scene_with(&[("a", "1"), ("b", "2"), ("deep/c", "3"), ("d", "4")]);
        let mut hashes = SceneHashes::empty(root.path(), &id);
        hashes.update().unwrap();
        let place = |file: &str| root.path().join("scenes/room").join(file);
        let unfinished = mateval_image::temporary::beside(&place("a")).unwrap();
        std::fs::write(&unfinished, "half").unwrap();
        assert_eq!(codes(SceneHashes::open(root.path(), &id).unwrap().check(|_| true).unwrap()), [""; 0]);
        // Written again with the same bytes: another time, and the same file.
        std::fs::write(place("d"), "4").unwrap();
        // Of the same size and time, as `cp --preserve` makes it.
        let time = std::fs::metadata(place("a")).unwrap().modified().unwrap();
        std::fs::write(place("a"), "x").unwrap();
        std::fs::File::options().write(true).open(place("a")).unwrap().set_modified(time).unwrap();
        std::fs::remove_file(place("b")).unwrap();
        std::fs::write(place("deep/e"), "5").unwrap();
        let mut hashes = SceneHashes::open(root.path(), &id).unwrap();
        let all = ["changed_file scenes/room/a", "missing_file scenes/room/b", "unlisted_file scenes/room/deep/e"];
        let mut found = codes(hashes.check(|_| true).unwrap());
        found.sort();
        assert_eq!(found, all);
        assert_eq!(codes(hashes.check(|file| file.ends_with("/b")).unwrap()), all[1..2]);
        hashes.update().unwrap();
        assert_eq!(codes(SceneHashes::open(root.path(), &id).unwrap().check(|_| true).unwrap()), [""; 0]);
        assert!(unfinished.exists(), "its owner lives");
    }

    /// The list of a scene that the manifest describes too must not hide another dataset that was unpacked over this one.
    #[test]
    fn the_manifest_counts_where_nothing_was_changed_apart() {
        let (root, id) = scene_with(&[("a", "1")]);
        let mut hashes = SceneHashes::empty(root.path(), &id);
        hashes.update().unwrap();
        let line = |text: &str| format!("{}  scenes/room/a\n", manifest::sha256_of_bytes(text.as_bytes()));
        let check = || SceneHashes::open(root.path(), &id).unwrap().check(|_| true).unwrap().len();
        std::fs::write(root.path().join("MANIFEST.sha256"), line("1")).unwrap();
        assert_eq!(check(), 0);
        std::fs::write(root.path().join("MANIFEST.sha256"), line("2")).unwrap();
        assert_eq!(check(), 1);
        BuildFolder::of(root.path()).note_change(&id).unwrap();
        assert_eq!(check(), 0);
    }

    #[test]
    fn a_damaged_list_counts_as_missing() {
        let (root, id) = scene_with(&[("a", "1")]);
        SceneHashes::empty(root.path(), &id).update().unwrap();
        std::fs::write(BuildFolder::of(root.path()).hashes(&id), "{").unwrap();
        let found = codes(SceneHashes::open(root.path(), &id).unwrap().check(|_| true).unwrap());
        assert_eq!(found, ["unlisted_file scenes/room/a"]);
    }
}
