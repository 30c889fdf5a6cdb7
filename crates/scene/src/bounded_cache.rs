//! The bound on the size of a cache: a folder whose entries are files, or folders of files.
//!
//! Whoever reads an entry marks it as used now. Whoever adds one removes those that were not used for longest until the rest
//! is small enough, but none that was used within the last hour, which another process may be reading.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Entries that were used within this time stay.
const SPARED: Duration = Duration::from_secs(3600);

/// Marks an entry as used now by one of its files, or the entry itself if it is a file. Without the permission to do so it
/// counts as older than it is.
pub fn mark_used(file: &Path) {
    // Reading the entry matters more than keeping it.
    let _ = std::fs::File::options().append(true).open(file).and_then(|file| file.set_modified(SystemTime::now()));
}

/// Removes what was not used for longest until the entries of `cache` take at most `most_bytes`. An entry was last used when
/// the newest of its files was.
pub fn keep_below(cache: &Path, most_bytes: u64) -> io::Result<()> {
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(cache)? {
        let path = entry?.path();
        // Another process may have removed it in the meantime.
        entries.extend(Entry::of(path).ok());
    }
    entries.sort_by_key(|entry| entry.used);
    let mut bytes: u64 = entries.iter().map(|entry| entry.bytes).sum();
    for entry in entries {
        let is_idle = entry.used.elapsed().is_ok_and(|age| age > SPARED);
        if bytes <= most_bytes || !is_idle {
            break;
        }
        entry.remove()?;
        bytes -= entry.bytes;
    }
    Ok(())
}

/// A file or folder of a cache.
struct Entry {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
}

impl Entry {
    fn of(path: PathBuf) -> io::Result<Self> {
        let own = path.metadata()?;
        if !own.is_dir() {
            return Ok(Self { path, bytes: own.len(), used: own.modified()? });
        }
        let (mut bytes, mut used) = (0, None);
        for file in std::fs::read_dir(&path)? {
            let file = file?.metadata()?;
            bytes += file.len();
            used = used.max(Some(file.modified()?));
        }
        Ok(Self { path, bytes, used: used.map_or_else(|| own.modified(), Ok)? })
    }

    fn remove(&self) -> io::Result<()> {
        // Renamed first: a folder that is removed in part must not be found.
        let removed = self.path.with_extension("removed");
        match std::fs::rename(&self.path, &removed) {
            // Another process has removed it.
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            renamed => renamed?,
        }
        if removed.is_dir() { std::fs::remove_dir_all(&removed) } else { std::fs::remove_file(&removed) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set_used(file: &Path, hours_ago: u64) {
        let file = std::fs::File::options().append(true).open(file).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_secs(3600 * hours_ago)).unwrap();
    }

    /// A folder of 100 bytes, and its empty list, which was used `hours_ago`.
    fn folder(cache: &Path, name: &str, hours_ago: u64) -> [PathBuf; 2] {
        let folder = cache.join(name);
        let [picture, list] = ["input_a.exr", "list.json"].map(|name| folder.join(name));
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(&picture, [0; 100]).unwrap();
        std::fs::write(&list, []).unwrap();
        set_used(&picture, 50);
        set_used(&list, hours_ago);
        [folder, list]
    }

    #[test]
    fn what_was_not_used_for_longest_goes_first() {
        let cache = tempfile::tempdir().unwrap();
        let [old, older, new] = [("a", 5), ("b", 9), ("c", 0)].map(|(name, hours)| folder(cache.path(), name, hours));
        let file = cache.path().join("d");
        std::fs::write(&file, [0; 100]).unwrap();
        set_used(&file, 7);
        let left = || [&old[0], &older[0], &new[0], &file].map(|entry| entry.exists());
        keep_below(cache.path(), 400).unwrap();
        assert_eq!(left(), [true, true, true, true]);
        keep_below(cache.path(), 399).unwrap();
        assert_eq!(left(), [true, false, true, true]);
        mark_used(&old[1]);
        keep_below(cache.path(), 0).unwrap();
        assert_eq!(left(), [true, false, true, false], "what is in use stays");
        set_used(&old[1], 2);
        keep_below(cache.path(), 0).unwrap();
        assert_eq!(left(), [false, false, true, false]);
        assert_eq!(std::fs::read_dir(cache.path()).unwrap().count(), 1);
    }
}
