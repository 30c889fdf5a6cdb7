//! The folder of an untrusted scene: makes the file names in its files safe, reads files within limits and keeps their
//! hashes.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use mateval_image::limits::{hint, is_lfs_pointer};

use crate::findings::shortened;
use crate::manifest::sha256_of_bytes;

/// Why a file that another file names was not read.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct FileFault {
    /// The finding's code.
    pub code: &'static str,
    /// What was expected and what was found.
    pub message: String,
}

/// A source's folder. No file outside it is read.
#[derive(Debug)]
pub struct SourceFolder {
    root: PathBuf,
    file_bytes: u64,
    hashes: BTreeMap<String, String>,
    /// Files that were looked for and do not exist.
    absent: BTreeSet<String>,
}

/// Files that were looked for; both lists are sorted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LookedFor {
    /// The files that were read, with their SHA-256.
    pub hashes: Vec<(String, String)>,
    /// The files that do not exist.
    pub absent: Vec<String>,
}

impl LookedFor {
    /// The same files with other names.
    pub fn renamed(self, name: impl Fn(String) -> String) -> Self {
        let hashes = self.hashes.into_iter().map(|(file, hash)| (name(file), hash)).collect();
        Self { hashes, absent: self.absent.into_iter().map(name).collect() }
    }

    /// Adds the files of another.
    pub fn extend(&mut self, other: Self) {
        self.hashes.extend(other.hashes);
        self.hashes.sort();
        self.absent.extend(other.absent);
        self.absent.sort();
    }
}

impl SourceFolder {
    /// The folder `root`. Files of more than `file_bytes` are refused.
    pub fn new(root: &Path, file_bytes: u64) -> std::io::Result<Self> {
        let root = if root.as_os_str().is_empty() { Path::new(".") } else { root };
        Ok(Self { root: root.canonicalize()?, file_bytes, hashes: BTreeMap::new(), absent: BTreeSet::new() })
    }

    /// Converts a file name from a file to forward slashes without `.` and `..`. Fails where it leads out of the
    /// folder.
    pub fn relative(name: &str) -> Result<String, FileFault> {
        let forward = name.trim().replace('\\', "/");
        let escapes = || FileFault {
            code: "path_escapes",
            message: format!("'{}' leads out of the scene's folder", shortened(name)),
        };
        if forward.is_empty() || forward.contains('\0') || forward.len() > 1024 {
            let message = format!("expected a file name, found '{}'", shortened(name));
            return Err(FileFault { code: "bad_value", message });
        }
        let drive = forward.as_bytes().get(1) == Some(&b':');
        if forward.starts_with('/') || drive {
            return Err(escapes());
        }
        let mut parts: Vec<&str> = Vec::new();
        for part in forward.split('/') {
            match part {
                "" | "." => {}
                ".." => drop(parts.pop().ok_or_else(escapes)?),
                part => parts.push(part),
            }
        }
        if parts.is_empty() { Err(escapes()) } else { Ok(parts.join("/")) }
    }

    /// The bytes of the file `relative`.
    pub fn read(&mut self, relative: &str) -> Result<Vec<u8>, FileFault> {
        let path = self.path(relative)?;
        let unreadable = |error: std::io::Error| FileFault {
            code: "unreadable_file",
            message: format!("'{}' cannot be read: {error}", shortened(relative)),
        };
        let file = std::fs::File::open(&path).map_err(unreadable)?;
        let mut bytes = Vec::new();
        file.take(self.file_bytes + 1).read_to_end(&mut bytes).map_err(unreadable)?;
        if bytes.len() as u64 > self.file_bytes {
            return Err(self.too_large(relative));
        }
        if is_lfs_pointer(&bytes) {
            let message = format!("'{}' cannot be read{}", shortened(relative), hint(&bytes));
            return Err(FileFault { code: "lfs_pointer", message });
        }
        self.hashes.insert(relative.to_owned(), sha256_of_bytes(&bytes));
        Ok(bytes)
    }

    /// Whether the folder holds the file `relative`.
    pub fn contains(&self, relative: &str) -> bool {
        self.root.join(relative).is_file()
    }

    /// The path of the file `relative`. Fails unless it is an ordinary file inside the folder and within the limit.
    pub fn path(&mut self, relative: &str) -> Result<PathBuf, FileFault> {
        let short = shortened(relative);
        let path = match self.root.join(relative).canonicalize() {
            Ok(path) => path,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                self.absent.insert(relative.to_owned());
                return Err(FileFault { code: "missing_file", message: format!("the file '{short}' does not exist") });
            }
            Err(error) => {
                let message = format!("'{short}' cannot be read: {error}");
                return Err(FileFault { code: "unreadable_file", message });
            }
        };
        if !path.starts_with(&self.root) {
            let message = format!(
                "'{short}' is a link that leads out of the folder, which is not followed; link the whole folder"
            );
            return Err(FileFault { code: "path_escapes", message });
        }
        match path.metadata() {
            Ok(data) if data.is_file() && data.len() <= self.file_bytes => Ok(path),
            Ok(data) if data.is_file() => Err(self.too_large(relative)),
            _ => Err(FileFault { code: "unreadable_file", message: format!("'{short}' is not an ordinary file") }),
        }
    }

    fn too_large(&self, relative: &str) -> FileFault {
        let message = format!("'{}' has more than {} bytes", shortened(relative), self.file_bytes);
        FileFault { code: "limit", message }
    }

    /// The hash of a file that was read.
    pub fn hash(&self, relative: &str) -> Option<String> {
        self.hashes.get(relative).cloned()
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The files that were looked for.
    pub fn into_files(self) -> LookedFor {
        LookedFor { hashes: self.hashes.into_iter().collect(), absent: self.absent.into_iter().collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_inside() {
        for (name, relative) in [("models\\a b.obj", "models/a b.obj"), ("./a/../b.png", "b.png"), ("a..b", "a..b")] {
            assert_eq!(SourceFolder::relative(name).unwrap(), relative);
        }
        for bad in ["../a", "a/../../b", "/etc/passwd", "C:\\a", "", "..", ".", "a/.."] {
            assert!(SourceFolder::relative(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn reads_hashes_and_limits() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a"), "abc").unwrap();
        let mut source = SourceFolder::new(folder.path(), 3).unwrap();
        assert_eq!(source.read("a").unwrap(), b"abc");
        // FIPS 180-2's example.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(source.hash("a").unwrap(), expected);
        std::fs::write(folder.path().join("b"), "abcd").unwrap();
        assert_eq!(source.read("b").unwrap_err().code, "limit");
        assert_eq!(source.read("c").unwrap_err().code, "missing_file");
        let mut pointers = SourceFolder::new(folder.path(), 1000).unwrap();
        std::fs::write(folder.path().join("p.png"), "version https://git-lfs.github.com/spec/v1\n").unwrap();
        assert_eq!(pointers.read("p.png").unwrap_err().code, "lfs_pointer");
        std::fs::create_dir(folder.path().join("d")).unwrap();
        assert_eq!(source.read("d").unwrap_err().code, "unreadable_file");
        let looked_for = source.into_files();
        assert_eq!((looked_for.hashes.len(), looked_for.absent), (1, vec!["c".to_owned()]));
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_are_refused() {
        let (folder, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        std::fs::write(outside.path().join("a"), "abc").unwrap();
        std::os::unix::fs::symlink(outside.path().join("a"), folder.path().join("a")).unwrap();
        let mut source = SourceFolder::new(folder.path(), 3).unwrap();
        assert_eq!(source.read("a").unwrap_err().code, "path_escapes");
    }
}
