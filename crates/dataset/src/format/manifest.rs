//! `MANIFEST.sha256`: a line `<sha256>  <path>` for each file, sorted by path, in the format of `sha256sum -c`.
//!
//! [`SceneHashes`] keeps the hashes of one scene's files in `.build`, so that the manifest is written without reading
//! them again; [`change_scene`] lets one process at a time change a scene without hiding other changes.

use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use mateval_files::untrusted::{sha256_of_bytes, sha256_of_file};
use mateval_files::whole::{is_abandoned, is_temporary, write_whole};
use mateval_files::{FileError, work_folder};
use serde::{Deserialize, Serialize};

use crate::layout::{BuildFolder, COMPARE, DATASET, MANIFEST, SceneFolder, is_rendered};
use crate::{Finding, SceneError, SceneId, Severity, json};

/// The code of a finding about a file that the manifest lists and the dataset lacks.
pub const MISSING_FILE: &str = "missing_file";

/// Whether a file is missing because the whole ground truth of its scene is withheld, which is not a fault.
pub fn is_withheld(root: &Path, finding: &Finding) -> bool {
    let folder = finding.file.split_once("/ground_truth/").map(|(scene, _)| root.join(scene).join("ground_truth"));
    finding.code == MISSING_FILE && folder.is_some_and(|folder| !folder.exists())
}
const UNLISTED_FILE: &str = "unlisted_file";

/// The files below `root`, relative and sorted, without the manifest, `dataset.json`, `compare.json` and hidden files
/// in `root` itself. Links to folders are not followed.
pub fn list_files(root: &Path) -> Result<Vec<String>, SceneError> {
    let mut files = list_below(root, Path::new(""))?;
    files.retain(|file| ![MANIFEST, DATASET, COMPARE].contains(&file.as_str()) && !file.starts_with('.'));
    Ok(files)
}

/// The files below the folder `below` of `root`, relative to `root` and sorted. Links to folders are not followed.
fn list_below(root: &Path, below: &Path) -> Result<Vec<String>, SceneError> {
    let mut files = Vec::new();
    let mut folders = vec![below.to_owned()];
    while let Some(folder) = folders.pop() {
        let path = root.join(&folder);
        for entry in std::fs::read_dir(&path).map_err(FileError::io("list", &path))? {
            let entry = entry.map_err(FileError::io("list", &path))?;
            let relative = folder.join(entry.file_name());
            let kind = entry.file_type().map_err(FileError::io("look at", entry.path()))?;
            if kind.is_dir() {
                folders.push(relative);
            } else {
                files.push(relative.to_string_lossy().replace('\\', "/"));
            }
        }
    }
    files.sort();
    Ok(files)
}

/// Removes the unfinished files and folders below `folder` whose processes are gone.
fn remove_abandoned(folder: &Path) -> Result<(), SceneError> {
    remove_those(folder, is_abandoned)
}

/// Removes all unfinished files and folders below `folder`, for a caller that holds the leases of everybody who writes
/// there.
pub fn remove_unfinished(folder: &Path) -> Result<(), SceneError> {
    remove_those(folder, |path| path.file_name().is_some_and(|name| is_temporary(&name.to_string_lossy())))
}

fn remove_those(folder: &Path, is_unwanted: fn(&Path) -> bool) -> Result<(), SceneError> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    for entry in entries.flatten() {
        let path = entry.path();
        if is_unwanted(&path) {
            work_folder::remove(&path)?;
        } else if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            remove_those(&path, is_unwanted)?;
        }
    }
    Ok(())
}

/// Hashes every file of the dataset and writes the manifest; unfinished files are left out, and removed where their
/// processes are gone. Returns the manifest's own hash, which `dataset.json` holds.
pub fn write(root: &Path) -> Result<String, SceneError> {
    write_with(root, &BTreeMap::new())
}

/// Like [`write()`], without reading the files whose hashes are `known` by their paths in the dataset.
pub fn write_with(root: &Path, known: &BTreeMap<String, String>) -> Result<String, SceneError> {
    let mut text = String::new();
    remove_abandoned(&root.join("scenes"))?;
    for file in list_files(root)?.into_iter().filter(|file| !file.split('/').any(is_temporary)) {
        refuse_linked_folder(root, &file)?;
        match known.get(&file) {
            Some(sha256) => text.push_str(&format!("{sha256}  {file}\n")),
            None => text.push_str(&format!("{}  {file}\n", sha256_of_file(&root.join(&file))?)),
        }
    }
    write_whole(&root.join(MANIFEST), text.as_bytes())?;
    Ok(sha256_of_bytes(text.as_bytes()))
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// SHA-256 of the file, hex.
    pub sha256: String,
    /// The path relative to the dataset, with forward slashes; never outside it.
    pub file: String,
}

impl Entry {
    fn parse(line: &str) -> Option<Self> {
        let (sha256, file) = line.split_once("  ").filter(|(hash, file)| hash.len() == 64 && is_inside(file))?;
        Some(Self { sha256: sha256.to_owned(), file: file.to_owned() })
    }
}

/// The valid lines of the manifest in their order; [`check`] reports the others.
pub fn entries(root: &Path) -> Result<Vec<Entry>, SceneError> {
    let path = root.join(MANIFEST);
    let text = std::fs::read_to_string(&path).map_err(FileError::io("read", &path))?;
    Ok(text.lines().filter_map(Entry::parse).collect())
}

/// Compares every file with the manifest: each one that is missing, changed or not listed is a finding.
pub fn check(root: &Path) -> Result<Vec<Finding>, SceneError> {
    check_those(root, |_| true)
}

/// Compares those files with the manifest that `concerns` accepts by their paths in the dataset.
pub fn check_those(root: &Path, concerns: impl Fn(&str) -> bool) -> Result<Vec<Finding>, SceneError> {
    let path = root.join(MANIFEST);
    let text = std::fs::read_to_string(&path).map_err(FileError::io("read", &path))?;
    let mut findings = Vec::new();
    let mut listed = std::collections::BTreeSet::new();
    for (number, line) in text.lines().enumerate() {
        let Some(Entry { sha256: hash, file }) = Entry::parse(line) else {
            let place = format!("line {}", number + 1);
            findings.push(fault(
                "bad_manifest_line",
                MANIFEST,
                place,
                "expected '<sha256>  <path inside the dataset>'",
            ));
            continue;
        };
        if !concerns(&file) {
            continue;
        }
        listed.insert(file.clone());
        match sha256_of_file(&root.join(&file)) {
            Err(error) if root.join(&file).exists() => {
                findings.push(fault("unreadable", &file, String::new(), &error.to_string()));
            }
            Err(_) => findings.push(missing_file(&file)),
            Ok(found) if found != hash => findings.push(changed_file(&file, &found, &hash)),
            Ok(_) => {}
        }
    }
    for file in list_files(root)? {
        if concerns(&file) && !listed.contains(&file) {
            findings.push(unlisted_file(root, &file));
        }
    }
    Ok(findings)
}

const LINKED_FOLDER: &str = "a link to a folder, whose files no manifest lists";
const NO_LINKED_FOLDER: &str = "put the folder itself in the link's place, or mount it there";

/// Whether a file that was found is a link to a folder: folders themselves are walked through.
fn is_linked_folder(root: &Path, file: &str) -> bool {
    root.join(file).is_dir()
}

/// Fails if a file that was found is a link to a folder.
fn refuse_linked_folder(root: &Path, file: &str) -> Result<(), SceneError> {
    if !is_linked_folder(root, file) {
        return Ok(());
    }
    let what = format!("{LINKED_FOLDER}; {NO_LINKED_FOLDER}");
    Err(SceneError::Unsupported { path: root.join(file), what })
}

fn is_inside(file: &str) -> bool {
    Path::new(file).components().all(|part| matches!(part, std::path::Component::Normal(_)))
}

fn missing_file(file: &str) -> Finding {
    fault(MISSING_FILE, file, String::new(), "listed in the manifest, but missing")
}

fn changed_file(file: &str, found: &str, expected: &str) -> Finding {
    fault("changed_file", file, String::new(), &format!("SHA-256 is {found}, expected {expected}"))
}

fn unlisted_file(root: &Path, file: &str) -> Finding {
    if is_linked_folder(root, file) {
        let fault = fault("linked_folder", file, String::new(), LINKED_FOLDER);
        return Finding { action: NO_LINKED_FOLDER.to_owned(), ..fault };
    }
    fault(UNLISTED_FILE, file, String::new(), "not listed in the manifest")
}

fn fault(code: &str, file: &str, place: String, message: &str) -> Finding {
    Finding::new(Severity::Error, code, file, place, message, "fetch or build the dataset again")
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
    pub fn open(root: &Path, scene: &SceneId) -> Result<Self, SceneError> {
        let build = BuildFolder::of(root);
        let mut files: BTreeMap<String, Listed> = json::read(&build.hashes(scene)).unwrap_or_default();
        if root.join(crate::layout::MANIFEST).is_file() && !build.changed().contains(scene) {
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
    pub fn update(&mut self) -> Result<(), SceneError> {
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
    pub fn note_change(&self) -> Result<(), SceneError> {
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

    fn keep(&self) -> Result<(), SceneError> {
        let list = BuildFolder::of(&self.root).hashes(&self.scene);
        let parent = list.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(parent).map_err(FileError::io("make", parent))?;
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
        remove_abandoned(&self.root.join(folder(&self.scene)))?;
        let files = list_below(&self.root, Path::new(&folder(&self.scene)))?;
        Ok(files.into_iter().filter(|file| !file.split('/').any(is_temporary)).collect())
    }
}

/// The error where scenes that `concerns` accepts changed since the manifest was written.
pub fn unfinished(root: &Path, concerns: impl Fn(&SceneId) -> bool) -> Option<SceneError> {
    let scenes: Vec<SceneId> = BuildFolder::of(root).changed().into_iter().filter(concerns).collect();
    let command = finishing_command(root, &scenes);
    (!scenes.is_empty()).then(|| SceneError::Unfinished { path: root.to_owned(), scenes, command })
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
pub fn change_scene<T, E: From<SceneError>>(
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
        return Err(SceneError::Invalid { path: root.to_owned(), findings }.into());
    }
    hashes.note_change()?;
    let done = work()?;
    hashes.update()?;
    Ok(done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_missing_changed_and_unlisted() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        std::fs::create_dir(root.join("scenes")).unwrap();
        for name in ["scenes/a", "scenes/b", "c"] {
            std::fs::write(root.join(name), name).unwrap();
        }
        write(root).unwrap();
        assert!(check(root).unwrap().is_empty());
        let live = mateval_files::whole::beside(&root.join("scenes/e")).unwrap();
        let own = mateval_files::owner::Owner::this_process();
        let dead = root.join(format!("scenes/.e.{}-{}-1-0.partial", own.host, own.process));
        for path in [&live, &dead] {
            std::fs::write(path, "half").unwrap();
        }
        write(root).unwrap();
        assert!(live.exists() && !dead.exists());
        assert_eq!(check(root).unwrap().len(), 1, "the unfinished file alone is not listed");
        std::fs::remove_file(live).unwrap();
        std::fs::remove_file(root.join("scenes/a")).unwrap();
        std::fs::write(root.join("scenes/b"), "other").unwrap();
        std::fs::write(root.join("d"), "new").unwrap();
        let codes: Vec<String> = check(root).unwrap().into_iter().map(|f| format!("{} {}", f.code, f.file)).collect();
        assert_eq!(codes, ["missing_file scenes/a", "changed_file scenes/b", "unlisted_file d"]);
    }

    #[cfg(unix)]
    #[test]
    fn linked_folders_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        std::fs::create_dir_all(root.join("scenes/a")).unwrap();
        std::fs::write(root.join("scenes/a/x"), "x").unwrap();
        write(root).unwrap();
        std::os::unix::fs::symlink(root.join("scenes/a"), root.join("scenes/b")).unwrap();
        let found = check(root).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((found[0].code.as_str(), found[0].file.as_str()), ("linked_folder", "scenes/b"));
        let error = write(root).unwrap_err().to_string();
        assert!(error.contains("scenes/b") && error.contains("a link to a folder"), "{error}");
    }

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
