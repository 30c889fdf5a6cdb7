//! Writes a file whole or not at all: beside its place first, then renamed.
//!
//! The name of an unfinished file or folder states its owner, so that nobody removes what another process writes:
//! `.NAME.HOST-PROCESS-START-COUNT.partial`.

use std::io::Write as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use crate::error::FileError;
use crate::owner::Owner;

/// Writes `bytes` to `path`, replacing an existing file. `path` never holds a half-written file, and of several
/// processes that write it at once the last one's bytes stay, whole.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_with(path, bytes, std::fs::File::options().write(true).create_new(true))
}

/// Like [`write_whole`], as a file that only its owner can read and write.
pub fn write_private(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_with(path, bytes, std::fs::File::options().write(true).create_new(true).mode(0o600))
}

fn write_with(path: &Path, bytes: &[u8], options: &std::fs::OpenOptions) -> Result<(), FileError> {
    let refused = FileError::io("write", path);
    let Some(partial) = beside(path) else {
        return Err(refused(std::io::ErrorKind::InvalidFilename.into()));
    };
    let written = options
        .open(&partial)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_data()))
        .and_then(|()| std::fs::rename(&partial, path));
    written.map_err(|source| {
        // The disk may be full, so the partial file is removed; if that fails too, the first error is reported.
        let _ = std::fs::remove_file(&partial);
        refused(source)
    })
}

/// How old the files of a process on another host must be before it counts as gone: longer than any scene takes, and
/// than clocks differ.
const GONE_AFTER: Duration = Duration::from_secs(24 * 3600);

const ENDING: &str = ".partial";

/// A name beside `place` that no other process and no other call uses; absent if `place` has no name, as in `.`.
pub fn beside(place: &Path) -> Option<PathBuf> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let mut name = prefix(place)?;
    name.push(format!("{}-{}{ENDING}", Owner::this_process(), COUNT.fetch_add(1, Ordering::Relaxed)));
    Some(place.with_file_name(name))
}

/// Whether the name of a file or folder is one of an unfinished one.
pub fn is_temporary(name: &str) -> bool {
    // Other programs have files of that ending too.
    owner(name).is_some()
}

/// The unfinished files and folders beside `place` whose owner is gone. Empty where their folder cannot be listed.
pub fn abandoned_beside(place: &Path) -> Vec<PathBuf> {
    let mut found = all_beside(place);
    found.retain(|path| is_abandoned(path));
    found
}

/// All unfinished files and folders beside `place`. Empty where their folder cannot be listed.
pub fn all_beside(place: &Path) -> Vec<PathBuf> {
    let Some(prefix) = prefix(place) else { return Vec::new() };
    let folder = match place.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let starts = prefix.to_string_lossy();
    entries
        .flatten()
        .filter(|entry| {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            name.starts_with(&*starts) && owner(&name).is_some()
        })
        .map(|entry| entry.path())
        .collect()
}

/// Whether an unfinished file or folder has lost its owner: a process of this host that has ended, or one of another
/// host that has written nothing for a day.
pub fn is_abandoned(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let Some(owner) = owner(&name) else { return false };
    owner
        .is_gone()
        .unwrap_or_else(|| last_change(path).is_some_and(|time| time.elapsed().is_ok_and(|age| age > GONE_AFTER)))
}

fn prefix(place: &Path) -> Option<std::ffi::OsString> {
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(place.file_name()?);
    prefix.push(".");
    Some(prefix)
}

/// The owner that a name states.
fn owner(name: &str) -> Option<Owner> {
    let (_, owner) = name.strip_suffix(ENDING)?.rsplit_once('.')?;
    Owner::parse(owner.rsplit_once('-')?.0)
}

/// The latest change of a file, or of anything in a folder.
fn last_change(path: &Path) -> Option<SystemTime> {
    let metadata = std::fs::symlink_metadata(path).ok()?;
    let own = metadata.modified().ok();
    if !metadata.is_dir() {
        return own;
    }
    let entries = std::fs::read_dir(path).ok()?;
    entries.flatten().filter_map(|entry| last_change(&entry.path())).chain(own).max()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_whole_and_leaves_nothing_beside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_whole(&path, b"old and long").unwrap();
        write_whole(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_refusal_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let error = write_whole(&folder.path().join("missing/a.txt"), b"x").unwrap_err();
        assert!(error.to_string().contains("a.txt"), "{error}");
    }

    fn made(folder: &Path, name: String, age: Duration) -> PathBuf {
        let path = folder.join(name);
        let file = std::fs::File::create(&path).unwrap();
        file.set_modified(SystemTime::now() - age).unwrap();
        path
    }

    #[test]
    fn only_those_without_an_owner_are_abandoned() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("rgb.png");
        let (Owner { host, process: own, .. }, long) = (Owner::this_process(), GONE_AFTER * 2);
        let mut ended = std::process::Command::new("true").spawn().unwrap();
        ended.wait().unwrap();
        let ours = made(folder.path(), beside(&place).unwrap().file_name().unwrap().to_string_lossy().into(), long);
        let cases = [
            (ours, false),
            (
                made(
                    folder.path(),
                    format!(".rgb.png.{host}-{}-1-0.partial", std::os::unix::process::parent_id()),
                    long,
                ),
                false,
            ),
            (made(folder.path(), format!(".rgb.png.{host}-{own}-1-0.partial"), Duration::ZERO), true),
            (made(folder.path(), format!(".rgb.png.{host}-{}-1-0.partial", ended.id()), Duration::ZERO), true),
            (made(folder.path(), ".rgb.png.other-1-1-0.partial".to_owned(), Duration::from_secs(3600)), false),
            (made(folder.path(), ".rgb.png.other-1-1-1.partial".to_owned(), long), true),
            (made(folder.path(), "rgb.png.partial".to_owned(), long), false),
            (made(folder.path(), "rgb.png".to_owned(), long), false),
        ];
        for (path, expected) in &cases {
            assert_eq!(is_abandoned(path), *expected, "{}", path.display());
        }
        let mut found = abandoned_beside(&place);
        found.sort();
        let mut expected: Vec<_> = [&cases[2], &cases[3], &cases[5]].map(|(path, _)| path.clone()).into();
        expected.sort();
        assert_eq!(found, expected);
    }

    /// A folder is as young as the youngest file in it.
    #[test]
    fn a_folder_that_is_being_filled_is_not_abandoned() {
        let folder = tempfile::tempdir().unwrap();
        let work = folder.path().join(".scene.other-1-1-0.partial");
        std::fs::create_dir(&work).unwrap();
        let file = made(&work, "a".to_owned(), Duration::ZERO);
        let old = SystemTime::now() - GONE_AFTER * 2;
        std::fs::File::open(&work).unwrap().set_modified(old).unwrap();
        assert!(!is_abandoned(&work));
        std::fs::File::options().write(true).open(&file).unwrap().set_modified(old).unwrap();
        assert!(is_abandoned(&work));
    }

    #[test]
    fn names_differ_from_call_to_call_and_need_a_name() {
        assert_ne!(beside(Path::new("a/b")), beside(Path::new("a/b")));
        assert_eq!(beside(Path::new("..")), None);
    }
}
