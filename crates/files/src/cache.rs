//! Caches: folders of entries that can be made again, each named by a hash of everything that it depends on.
//!
//! Whoever reads an entry marks it as used now. Whoever adds one may remove those that were not used for longest until
//! the rest is small enough, but none that was used within the last hour, which another process may be reading.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::error::FileError;
use crate::untrusted::{read_at_most, sha256_of_bytes};
use crate::whole::write_whole;
use crate::work_folder::make_folder;

/// The name of an entry: the SHA-256, hex, of everything that it depends on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key(String);

impl Key {
    /// The key of what depends on these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(sha256_of_bytes(bytes))
    }
}

impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

/// A folder of entries, which is made once something is kept. Several processes may use it at once.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
}

impl Cache {
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The file of an entry.
    pub fn path(&self, key: &Key) -> PathBuf {
        self.folder.join(&key.0)
    }

    /// An entry of at most `most_bytes`; absent if it was not kept.
    pub fn read(&self, key: &Key, most_bytes: u64) -> io::Result<Option<Vec<u8>>> {
        let path = self.path(key);
        match read_at_most(&path, most_bytes) {
            Ok(bytes) => {
                mark_used(&path);
                Ok(Some(bytes))
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Keeps an entry, in place of one of the same key.
    pub fn keep(&self, key: &Key, bytes: &[u8]) -> Result<(), FileError> {
        make_folder(&self.folder)?;
        write_whole(&self.path(key), bytes)
    }

    /// Removes what was not used for longest until all entries take at most `most_bytes`. An entry was last used when
    /// the newest of its files was.
    pub fn keep_below(&self, most_bytes: u64) -> io::Result<()> {
        let mut entries = Vec::new();
        for entry in std::fs::read_dir(&self.folder)? {
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
}

/// Entries that were used within this time stay.
const SPARED: Duration = Duration::from_secs(3600);

/// Marks an entry as used now by one of its files, or the entry itself if it is a file. Without the permission to do so
/// it counts as older than it is.
fn mark_used(file: &Path) {
    // Reading the entry matters more than keeping it.
    let _ = std::fs::File::options().append(true).open(file).and_then(|file| file.set_modified(SystemTime::now()));
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

    #[test]
    fn what_is_kept_is_read_again() {
        let root = tempfile::tempdir().unwrap();
        let cache = Cache::new(&root.path().join("cache"));
        let [key, other] = [b"a", b"b"].map(|bytes| Key::of(bytes));
        assert_eq!(cache.read(&key, 3).unwrap(), None);
        cache.keep(&key, b"old").unwrap();
        cache.keep(&key, b"new").unwrap();
        assert_eq!(cache.read(&key, 3).unwrap().as_deref(), Some(b"new".as_slice()));
        assert!(cache.read(&key, 2).is_err());
        assert_eq!(cache.read(&other, 3).unwrap(), None);
    }

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
        let root = tempfile::tempdir().unwrap();
        let cache = Cache::new(root.path());
        let [old, older, new] = [("a", 5), ("b", 9), ("c", 0)].map(|(name, hours)| folder(root.path(), name, hours));
        let file = root.path().join("d");
        std::fs::write(&file, [0; 100]).unwrap();
        set_used(&file, 7);
        let left = || [&old[0], &older[0], &new[0], &file].map(|entry| entry.exists());
        cache.keep_below(400).unwrap();
        assert_eq!(left(), [true, true, true, true]);
        cache.keep_below(399).unwrap();
        assert_eq!(left(), [true, false, true, true]);
        mark_used(&old[1]);
        cache.keep_below(0).unwrap();
        assert_eq!(left(), [true, false, true, false], "what is in use stays");
        set_used(&old[1], 2);
        cache.keep_below(0).unwrap();
        assert_eq!(left(), [false, false, true, false]);
        assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 1);
    }
}
