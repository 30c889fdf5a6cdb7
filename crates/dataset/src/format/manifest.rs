//! `MANIFEST.sha256`: a line `<sha256>  <path>` for each file, sorted by path, in the format of `sha256sum -c`; that of a
//! hidden split also names the files that it withholds (`withheld`).

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mateval_files::source_folder::slashed;
use mateval_files::untrusted::{sha256_of_bytes, sha256_of_file};
use mateval_files::whole::{is_abandoned, is_temporary, write_whole};
use mateval_files::{FileError, work_folder};

use super::withheld::{Line, SECRET, Secret, WITHHELD};
use crate::layout::{COMPARE, DATASET, MANIFEST};
use crate::{DatasetError, Finding, Severity};

/// The code of a finding about a file that the manifest lists and the dataset lacks.
pub const MISSING_FILE: &str = "missing_file";
pub(crate) const UNLISTED_FILE: &str = "unlisted_file";

/// The code of a finding about a file that a hidden split withholds.
pub const WITHHELD_FILE: &str = "withheld_file";

/// Whether a file is missing because it is withheld, or the whole ground truth of its scene is, which is not a fault.
pub fn is_withheld(root: &Path, finding: &Finding) -> bool {
    let folder = finding.file.split_once("/ground_truth/").map(|(scene, _)| root.join(scene).join("ground_truth"));
    finding.code == WITHHELD_FILE || finding.code == MISSING_FILE && folder.is_some_and(|folder| !folder.exists())
}

/// The files below `root`, relative and sorted, without the manifest, `dataset.json`, `compare.json`, what the manifest
/// of a hidden split leaves out, and hidden files in `root` itself. Links to folders are not followed.
pub fn list_files(root: &Path) -> Result<Vec<String>, DatasetError> {
    let mut files = list_below(root, Path::new(""))?;
    let never_listed = [MANIFEST, DATASET, COMPARE, WITHHELD, SECRET];
    files.retain(|file| !never_listed.contains(&file.as_str()) && !file.starts_with('.'));
    Ok(files)
}

/// The files below the folder `below` of `root`, relative to `root` and sorted. Links to folders are not followed.
pub(crate) fn list_below(root: &Path, below: &Path) -> Result<Vec<String>, DatasetError> {
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
                files.push(slashed(&relative));
            }
        }
    }
    files.sort();
    Ok(files)
}

/// Removes the unfinished files and folders below `folder` whose processes are gone.
pub(crate) fn remove_abandoned(folder: &Path) -> Result<(), DatasetError> {
    remove_those(folder, is_abandoned)
}

pub(crate) fn remove_those(folder: &Path, is_unwanted: fn(&Path) -> bool) -> Result<(), DatasetError> {
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
pub fn write(root: &Path) -> Result<String, DatasetError> {
    write_with(root, &BTreeMap::new())
}

/// Like [`write()`], without reading the files whose hashes are `known` by their paths in the dataset.
pub fn write_with(root: &Path, known: &BTreeMap<String, String>) -> Result<String, DatasetError> {
    if root.join(WITHHELD).exists() {
        let what = "a hidden split is never changed, since its commitment would be broken; change the dataset that it was \
                    made from, and publish that again";
        return Err(DatasetError::Unsupported { path: root.to_owned(), what: what.to_owned() });
    }
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

/// What the manifest of a dataset lists.
#[derive(Clone, Debug, Default)]
pub struct Manifest {
    /// The files whose hashes are known, in the order of the lists.
    pub entries: Vec<Entry>,
    /// The names of withheld files whose hashes do not lie here.
    pub withheld: Vec<String>,
    /// The commitment of a hidden split.
    pub commitment: Option<String>,
    /// What is wrong with its lines, or with the list of withheld files.
    faults: Vec<Finding>,
}

impl Manifest {
    /// Reads the manifest of the dataset in `root`, and the list of withheld files if it lies beside it.
    pub fn read(root: &Path) -> Result<Self, DatasetError> {
        let text_of = |name: &str| {
            let path = root.join(name);
            std::fs::read_to_string(&path).map_err(FileError::io("read", &path))
        };
        let mut found = Self::default();
        for (number, line) in text_of(MANIFEST)?.lines().enumerate() {
            match (Entry::parse(line), Line::parse(line)) {
                (Some(entry), _) => found.entries.push(entry),
                (None, Some(Line::Name(file))) if is_inside(file) => found.withheld.push(file.to_owned()),
                (None, Some(Line::Commitment(hash))) => found.commitment = Some(hash.to_owned()),
                (None, _) => found.faults.push(bad_line(MANIFEST, number)),
            }
        }
        if !root.join(WITHHELD).is_file() {
            return Ok(found);
        }
        let list = text_of(WITHHELD)?;
        for (number, line) in list.lines().enumerate() {
            match Entry::parse(line).filter(|entry| found.withheld.contains(&entry.file)) {
                Some(entry) => found.entries.push(entry),
                None => found.faults.push(bad_line(WITHHELD, number)),
            }
        }
        let known: BTreeSet<&String> = found.entries.iter().map(|entry| &entry.file).collect();
        found.withheld.retain(|file| !known.contains(file));
        found.faults.extend(found.withheld.iter().map(|file| {
            fault("bad_manifest_line", WITHHELD, String::new(), &format!("it lacks '{file}', which the manifest names"))
        }));
        if root.join(SECRET).is_file() {
            let secret = Secret::read(&root.join(SECRET))?;
            found.faults.extend(found.broken_commitment(&secret, list.as_bytes()));
        }
        Ok(found)
    }

    fn broken_commitment(&self, secret: &Secret, list: &[u8]) -> Option<Finding> {
        let found = secret.commitment(list);
        let message = match &self.commitment {
            Some(stated) if *stated == found => return None,
            Some(stated) => format!("the commitment to it is {found} under this secret, published was {stated}"),
            None => "the manifest holds no commitment".to_owned(),
        };
        Some(fault("broken_commitment", WITHHELD, String::new(), &message))
    }
}

/// Checks that the list of withheld files, which lies in `root`, is the one that was committed to when the split was
/// published: by the secret that its keeper published later.
pub fn check_opened(root: &Path, secret: &Secret) -> Result<Option<Finding>, DatasetError> {
    let path = root.join(WITHHELD);
    let list = std::fs::read(&path).map_err(FileError::io("read", &path))?;
    Ok(Manifest::read(root)?.broken_commitment(secret, &list))
}

fn bad_line(file: &str, number: usize) -> Finding {
    let expected = match file {
        MANIFEST => "expected '<sha256>  <path inside the dataset>'",
        _ => "expected '<sha256>  <path>' of a file that the manifest names as withheld",
    };
    fault("bad_manifest_line", file, format!("line {}", number + 1), expected)
}

/// The lines of entries, as a manifest and the list of withheld files hold them.
pub fn lines(entries: &[Entry]) -> String {
    entries.iter().map(|entry| format!("{}  {}\n", entry.sha256, entry.file)).collect()
}

/// The text of a hidden split's manifest: the lines of public files, the names of the withheld ones, and the
/// commitment.
pub fn public_lines(public: &[Entry], withheld: &[Entry], commitment: &str) -> String {
    let names: String = withheld.iter().map(|entry| format!("{}\n", Line::Name(&entry.file))).collect();
    format!("{}{names}{}\n", lines(public), Line::Commitment(commitment))
}

/// The files whose hashes are known, in the order of the lists; [`check`] reports what is wrong with the lists.
pub fn entries(root: &Path) -> Result<Vec<Entry>, DatasetError> {
    Ok(Manifest::read(root)?.entries)
}

/// Compares every file with the manifest: each one that is missing, changed or not listed is a finding.
pub fn check(root: &Path) -> Result<Vec<Finding>, DatasetError> {
    check_those(root, |_| true)
}

/// Compares those files with the manifest that `concerns` accepts by their paths in the dataset.
pub fn check_those(root: &Path, concerns: impl Fn(&str) -> bool) -> Result<Vec<Finding>, DatasetError> {
    let manifest = Manifest::read(root)?;
    let mut findings = manifest.faults;
    let mut listed = BTreeSet::new();
    for Entry { sha256: hash, file } in manifest.entries.into_iter().filter(|entry| concerns(&entry.file)) {
        match sha256_of_file(&root.join(&file)) {
            Err(error) if root.join(&file).exists() => {
                findings.push(fault("unreadable", &file, String::new(), &error.to_string()));
            }
            Err(_) => findings.push(missing_file(&file)),
            Ok(found) if found != hash => findings.push(changed_file(&file, &found, &hash)),
            Ok(_) => {}
        }
        listed.insert(file);
    }
    for file in manifest.withheld.into_iter().filter(|file| concerns(file)) {
        if root.join(&file).exists() {
            let message =
                format!("its hash is withheld, and '{WITHHELD}' is missing, which lies with the withheld files");
            findings.push(fault(UNLISTED_FILE, &file, String::new(), &message));
            listed.insert(file);
        } else {
            findings.push(fault(WITHHELD_FILE, &file, String::new(), "the manifest names it as withheld"));
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
pub(crate) fn refuse_linked_folder(root: &Path, file: &str) -> Result<(), DatasetError> {
    if !is_linked_folder(root, file) {
        return Ok(());
    }
    let what = format!("{LINKED_FOLDER}; {NO_LINKED_FOLDER}");
    Err(DatasetError::Unsupported { path: root.join(file), what })
}

fn is_inside(file: &str) -> bool {
    Path::new(file).components().all(|part| matches!(part, std::path::Component::Normal(_)))
}

pub(crate) fn missing_file(file: &str) -> Finding {
    fault(MISSING_FILE, file, String::new(), "listed in the manifest, but missing")
}

pub(crate) fn changed_file(file: &str, found: &str, expected: &str) -> Finding {
    fault("changed_file", file, String::new(), &format!("SHA-256 is {found}, expected {expected}"))
}

pub(crate) fn unlisted_file(root: &Path, file: &str) -> Finding {
    if is_linked_folder(root, file) {
        let fault = fault("linked_folder", file, String::new(), LINKED_FOLDER);
        return Finding { action: NO_LINKED_FOLDER.to_owned(), ..fault };
    }
    fault(UNLISTED_FILE, file, String::new(), "not listed in the manifest")
}

fn fault(code: &str, file: &str, place: String, message: &str) -> Finding {
    Finding::new(Severity::Error, code, file, place, message, "fetch or build the dataset again")
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
}
