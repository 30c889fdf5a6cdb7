//! Who may change a dataset and its scenes, and what changed since the manifest was written.
//!
//! A process takes a [lease](BuildFolder::lease_of_scene) of what it changes. [`SceneHashes`] keeps the hashes of one
//! scene's files in `.build`, so that a change of any other file is found and the manifest is written without reading
//! them again. [`change_scene`] does both around the work of a command.

use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use mateval_files::lease::{Lease, LeaseSet};
use mateval_files::untrusted::sha256_of_file;
use mateval_files::whole::{is_temporary, write_whole};
use mateval_files::{FileError, work_folder};
use serde::{Deserialize, Serialize};

use crate::layout::{BuildFolder, MANIFEST, SceneFolder, is_rendered};
use crate::manifest::{
    UNLISTED_FILE, changed_file, entries, list_below, missing_file, refuse_linked_folder, remove_abandoned,
    remove_those, unlisted_file,
};
use crate::{DatasetError, Finding, SceneId, json};

impl BuildFolder {
    /// The right to change a scene. Fails where another process changes it or finishes the dataset.
    pub fn lease_of_scene(&self, scene: &SceneId) -> Result<Lease, DatasetError> {
        Ok(self.leases().part(scene.as_str())?)
    }

    /// The right to write the files that describe the whole dataset, or to replace it. Fails where another process does
    /// so, or changes a scene. `scenes` are those that are known.
    pub fn lease_of_whole(&self, scenes: &[SceneId]) -> Result<Lease, DatasetError> {
        Ok(self.leases().whole(scenes.iter().map(SceneId::as_str))?)
    }

    /// The right to begin or change the build; waits for other processes, which need it for a moment.
    pub fn lease_of_start(&self) -> Result<Lease, DatasetError> {
        Ok(Lease::wait(&self.path().join("leases/start"), "the start of the build")?)
    }

    /// The right to write the dataset's `compare.json`; waits for other processes, which need it for a moment.
    pub fn lease_of_verdict(&self) -> Result<Lease, DatasetError> {
        Ok(Lease::wait(&self.path().join("leases/verdict"), "the dataset's compare.json")?)
    }

    fn leases(&self) -> LeaseSet {
        LeaseSet { folder: self.path().join("leases"), part: "scene", whole: "the dataset's manifest" }
    }

    /// Notes that the scene is about to differ from what the manifest lists.
    pub fn note_change(&self, scene: &SceneId) -> Result<(), DatasetError> {
        let path = self.changed_folder();
        work_folder::make_folder(&path)?;
        let path = path.join(scene.as_str());
        Ok(std::fs::write(&path, "").map_err(FileError::io("write", path))?)
    }

    /// The scenes that differ from what the manifest lists.
    pub fn changed(&self) -> Vec<SceneId> {
        let Ok(entries) = std::fs::read_dir(self.changed_folder()) else { return Vec::new() };
        let mut changed: Vec<SceneId> =
            entries.flatten().filter_map(|entry| SceneId::new(entry.file_name().to_str()?).ok()).collect();
        changed.sort();
        changed
    }

    /// Notes that the manifest lists all scenes as they are.
    pub fn forget_changes(&self) -> Result<(), DatasetError> {
        Ok(work_folder::remove(&self.changed_folder())?)
    }

    fn changed_folder(&self) -> PathBuf {
        self.path().join("changed")
    }
}

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
    /// The list of a scene. Of a scene that has not changed since the manifest was written, the manifest's hashes
    /// count. A list that cannot be read counts as missing.
    pub fn open(root: &Path, scene: &SceneId) -> Result<Self, DatasetError> {
        let build = BuildFolder::of(root);
        let mut files: BTreeMap<String, Listed> = json::read(&build.hashes(scene)).unwrap_or_default();
        if root.join(MANIFEST).is_file() && !build.changed().contains(scene) {
            let folder = folder(scene);
            let listed = entries(root)?.into_iter().filter(|entry| entry.file.starts_with(&folder));
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
    /// compared that `concerns` accepts by their paths in the dataset, and only those are read whose size or times are
    /// not those of the list.
    pub fn check(&mut self, concerns: impl Fn(&str) -> bool) -> Result<Vec<Finding>, DatasetError> {
        let mut findings = Vec::new();
        for (file, listed) in self.files.iter_mut().filter(|(file, _)| concerns(file)) {
            let path = self.root.join(file);
            let stamp = Stamp::of(&path);
            if stamp.is_some() && stamp == listed.stamp {
                continue;
            }
            match sha256_of_file(&path) {
                Ok(found) if found == listed.sha256 => listed.stamp = stamp,
                Ok(found) => findings.push(changed_file(file, &found, &listed.sha256)),
                Err(_) if stamp.is_none() => findings.push(missing_file(file)),
                Err(error) => return Err(error.into()),
            }
        }
        let unlisted = self.found()?.into_iter().filter(|file| concerns(file) && !self.files.contains_key(file));
        findings.extend(unlisted.map(|file| unlisted_file(&self.root, &file)));
        findings.sort();
        Ok(findings.into_iter().map(|finding| self.with_advice(finding)).collect())
    }

    /// Lists the files as they are now, after `prep` wrote them, and keeps the list. Only those are read whose size or
    /// times are not those of the list.
    pub fn update(&mut self) -> Result<(), DatasetError> {
        let mut files = BTreeMap::new();
        for file in self.found()? {
            refuse_linked_folder(&self.root, &file)?;
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
    pub fn note_change(&self) -> Result<(), DatasetError> {
        self.keep()?;
        BuildFolder::of(&self.root).note_change(&self.scene)
    }

    /// The finding with the command that helps, whatever else is wrong with other scenes.
    fn with_advice(&self, finding: Finding) -> Finding {
        let (root, scene) = (self.root.display(), &self.scene);
        let action = match (rendered_by(&finding.file), finding.code.as_str()) {
            // Not this scene's alone, which would leave the manifest to `prep finish`.
            (Some(which), UNLISTED_FILE) => format!(
                "a render was interrupted: `mateval prep render {root} {which}` resumes it (with --scene {scene} in this \
                 scene alone)"
            ),
            // A render keeps a view that it finds done, whatever its pictures hold.
            (Some(which), _) => format!(
                "the file was changed by hand: `mateval prep render {root} {which} --scene {scene} --force` renders it again"
            ),
            (None, _) => {
                format!("the file was changed by hand: make the scene again by `prep build --scene {scene} --force`")
            }
        };
        Finding { action, ..finding }
    }

    fn keep(&self) -> Result<(), DatasetError> {
        let list = BuildFolder::of(&self.root).hashes(&self.scene);
        let parent = list.parent().unwrap_or(Path::new("."));
        work_folder::make_folder(parent)?;
        // Without line breaks: nobody reads it, and a room has hundreds of files.
        let text = serde_json::to_string(&self.files).expect("names, numbers and hashes become JSON");
        Ok(write_whole(&list, text.as_bytes())?)
    }

    /// Paths in the dataset and hashes, sorted by path.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &str)> {
        self.files.iter().map(|(file, listed)| (file.as_str(), listed.sha256.as_str()))
    }

    /// The scene's files but unfinished ones; those that a killed process left are removed.
    fn found(&self) -> Result<Vec<String>, DatasetError> {
        remove_abandoned(&self.root.join(folder(&self.scene)))?;
        let files = list_below(&self.root, Path::new(&folder(&self.scene)))?;
        Ok(files.into_iter().filter(|file| !file.split('/').any(is_temporary)).collect())
    }
}

/// Removes all unfinished files and folders below `folder`, for a caller that holds the leases of everybody who writes
/// there.
pub fn remove_unfinished(folder: &Path) -> Result<(), DatasetError> {
    remove_those(folder, |path| path.file_name().is_some_and(|name| is_temporary(&name.to_string_lossy())))
}

/// The error where scenes that `concerns` accepts changed since the manifest was written.
pub fn unfinished(root: &Path, concerns: impl Fn(&SceneId) -> bool) -> Option<DatasetError> {
    let scenes: Vec<SceneId> = BuildFolder::of(root).changed().into_iter().filter(concerns).collect();
    let command = finishing_command(root, &scenes);
    (!scenes.is_empty()).then(|| DatasetError::Unfinished { path: root.to_owned(), scenes, command })
}

/// The command after which the manifest lists the `changed` scenes: the render that was interrupted, which `prep finish`
/// would refuse to list, or else `prep finish`.
pub fn finishing_command(root: &Path, changed: &[SceneId]) -> String {
    let cut_off = changed.iter().find_map(|scene| {
        let hashes = SceneHashes::open(root, scene).ok()?;
        let files = list_below(root, Path::new(&folder(scene))).ok()?;
        let is_ours = |file: &&String| is_rendered(file) && !file.split('/').any(is_temporary);
        files.iter().filter(is_ours).find(|file| !hashes.files.contains_key(*file)).and_then(|file| rendered_by(file))
    });
    match cut_off {
        Some(which) => format!("mateval prep render {} {which}", root.display()),
        None => format!("mateval prep finish {}", root.display()),
    }
}

/// The options of `prep render` that make this file of a scene; absent if it is not rendered.
fn rendered_by(file: &str) -> Option<String> {
    let (renderer, _) = file.split_once("/ground_truth/renders/")?.1.split_once('/')?;
    Some(if renderer == "scorer" { "--only scorer".to_owned() } else { format!("--renderer {renderer}") })
}

fn folder(scene: &SceneId) -> String {
    format!("scenes/{scene}/")
}

/// Lets `work` write files of the scene, while no other process may, and lists all its files anew. `is_ours` accepts
/// those that `work` may write, by their paths in the dataset. Fails where any other file is not the one that is
/// listed, since a later manifest would list it as it is.
pub fn change_scene<T, E: From<DatasetError>>(
    root: &Path,
    scene: &SceneId,
    is_ours: impl Fn(&str) -> bool,
    work: impl FnOnce() -> Result<T, E>,
) -> Result<T, E> {
    let _lease = BuildFolder::of(root).lease_of_scene(scene)?;
    remove_unfinished(SceneFolder::of(root, scene).path())?;
    let mut hashes = SceneHashes::open(root, scene)?;
    let findings = hashes.check(|path| !is_ours(path))?;
    if !findings.is_empty() {
        return Err(DatasetError::Invalid { path: root.to_owned(), findings }.into());
    }
    hashes.note_change()?;
    let done = work()?;
    hashes.update()?;
    Ok(done)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mateval_files::untrusted::sha256_of_bytes;

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
        let unfinished = mateval_files::whole::beside(&place("a")).unwrap();
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

    /// `prep finish` refuses half a render, so its advice and that of the readers must not be each other.
    #[test]
    fn an_interrupted_render_is_resumed_by_one_command() {
        let (root, id) = scene_with(&[("a", "1"), ("ground_truth/renders/builtin/input/rgb.exr", "2")]);
        let shown = root.path().display();
        let mut hashes = SceneHashes::empty(root.path(), &id);
        hashes.update().unwrap();
        assert!(unfinished(root.path(), |_| true).is_none());
        BuildFolder::of(root.path()).note_change(&id).unwrap();
        let advice = || unfinished(root.path(), |_| true).unwrap().to_string();
        assert!(
            advice().ends_with(&format!("changed since its manifest was written; run `mateval prep finish {shown}`"))
        );
        let half = root.path().join("scenes/room/ground_truth/renders/blender/input");
        std::fs::create_dir_all(&half).unwrap();
        std::fs::write(half.join("rgb_a.exr"), "3").unwrap();
        let command = format!("`mateval prep render {shown} --renderer blender`");
        assert!(advice().ends_with(&format!("run {command}")), "{}", advice());
        let action = hashes.check(|_| true).unwrap().remove(0).action;
        assert!(action.contains(&command), "{action}");
    }

    /// The list of a scene that the manifest describes too must not hide another dataset that was unpacked over this
    /// one.
    #[test]
    fn the_manifest_counts_where_nothing_was_changed_apart() {
        let (root, id) = scene_with(&[("a", "1")]);
        let mut hashes = SceneHashes::empty(root.path(), &id);
        hashes.update().unwrap();
        let line = |text: &str| format!("{}  scenes/room/a\n", sha256_of_bytes(text.as_bytes()));
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
