//! The bound on the size of a cache of companions' pictures.
//!
//! Whoever reads an entry marks it as used now. Whoever adds one removes those that were not used for longest until the rest
//! is small enough, but none that was used within the last hour, which another process may be reading.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::companion_pictures::COMPANIONS_JSON;

/// The largest size of a cache, in bytes.
pub(crate) const MOST_BYTES: u64 = 20 << 30;

/// Entries that were used within this time stay.
const SPARED: Duration = Duration::from_secs(3600);

/// Marks an entry as used now. Without the permission to do so it counts as older than it is.
pub(crate) fn mark_used(entry: &Path) {
    // Reading the pictures matters more than keeping them.
    let _ = std::fs::File::options()
        .append(true)
        .open(entry.join(COMPANIONS_JSON))
        .and_then(|list| list.set_modified(SystemTime::now()));
}

/// Removes what was not used for longest until the folders in `cache` take at most `most_bytes`. Folders without a list,
/// which a killed run left, count from their last change.
pub(crate) fn keep_below(cache: &Path, most_bytes: u64) -> io::Result<()> {
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(cache)? {
        let path = entry?.path();
        // Another process may have removed it in the meantime.
        if let Ok(found) = Entry::of(path) {
            entries.extend(found);
        }
    }
    entries.sort_by_key(|entry| entry.used);
    let mut bytes: u64 = entries.iter().map(|entry| entry.bytes).sum();
    for entry in entries {
        let is_idle = entry.used.elapsed().is_ok_and(|age| age > SPARED);
        if bytes <= most_bytes || !is_idle {
            break;
        }
        // Renamed first: a folder that is removed in part must not be found.
        let removed = entry.path.with_extension("removed");
        std::fs::rename(&entry.path, &removed).and_then(|()| std::fs::remove_dir_all(&removed))?;
        bytes -= entry.bytes;
    }
    Ok(())
}

/// A folder of a cache.
struct Entry {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
}

impl Entry {
    /// None if the path is not a folder.
    fn of(path: PathBuf) -> io::Result<Option<Self>> {
        if !path.is_dir() {
            return Ok(None);
        }
        let mut bytes = 0;
        for file in std::fs::read_dir(&path)? {
            bytes += file?.metadata()?.len();
        }
        let list = path.join(COMPANIONS_JSON);
        let used = list.metadata().or_else(|_| path.metadata())?.modified()?;
        Ok(Some(Self { path, bytes, used }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder of 100 bytes and a list that was used so many hours ago.
    fn entry(cache: &Path, name: &str, hours: u64) -> PathBuf {
        let folder = cache.join(name);
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("input_a.exr"), [0; 100]).unwrap();
        let list = std::fs::File::create(folder.join(COMPANIONS_JSON)).unwrap();
        list.set_modified(SystemTime::now() - Duration::from_secs(3600 * hours)).unwrap();
        folder
    }

    #[test]
    fn what_was_not_used_for_longest_goes_first() {
        let cache = tempfile::tempdir().unwrap();
        let [old, older, new] = [("a", 5), ("b", 9), ("c", 0)].map(|(name, hours)| entry(cache.path(), name, hours));
        let left = || [&old, &older, &new].map(|entry| entry.exists());
        keep_below(cache.path(), 300).unwrap();
        assert_eq!(left(), [true, true, true]);
        keep_below(cache.path(), 299).unwrap();
        assert_eq!(left(), [true, false, true]);
        mark_used(&old);
        keep_below(cache.path(), 0).unwrap();
        assert_eq!(left(), [true, false, true], "what is in use stays");
        std::fs::File::options()
            .append(true)
            .open(old.join(COMPANIONS_JSON))
            .unwrap()
            .set_modified(SystemTime::now() - Duration::from_secs(7200))
            .unwrap();
        keep_below(cache.path(), 0).unwrap();
        assert_eq!(left(), [false, false, true]);
        assert_eq!(std::fs::read_dir(cache.path()).unwrap().count(), 1);
    }
}
