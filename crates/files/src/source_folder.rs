//! The folder of a source: paths relative to it, since a dataset must not record the folders of the machine that made
//! it; and the files in it that other files name, which are untrusted: names are made safe, files are read within
//! limits and their hashes kept.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};

use crate::untrusted::{hint, is_lfs_pointer, sha256_of_bytes, shortened};

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
        if forward.contains("://") {
            let message = format!(
                "'{}' is an address, which is not followed: put the file into the scene's folder and name it by its path there",
                shortened(name)
            );
            return Err(FileFault { code: "path_escapes", message });
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

/// Why a path is not below the source's folder.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BelowError {
    #[error("'{}' leads out of the source's folder", path.display())]
    LeadsOut { path: PathBuf },
    #[error("'{}' does not lie below '{}'", path.display(), source_folder.display())]
    Elsewhere { path: PathBuf, source_folder: PathBuf },
}

/// The path relative to `source`. Fails where it leads elsewhere. A relative path within the folder is returned
/// unchanged and may pass through links.
pub fn relative_below(path: &Path, source: &Path) -> Result<PathBuf, BelowError> {
    if !path.is_absolute() {
        let leads_out = || BelowError::LeadsOut { path: path.to_owned() };
        return if stays_inside(path) { Ok(path.to_owned()) } else { Err(leads_out()) };
    }
    // The path as it is written, or else with all links resolved.
    let as_written = || {
        let source = std::path::absolute(source).ok()?;
        let inside = path.strip_prefix(source).ok()?;
        stays_inside(inside).then(|| inside.to_owned())
    };
    let resolved =
        || Some(path.canonicalize().ok()?.strip_prefix(folder_or_here(source).canonicalize().ok()?).ok()?.to_owned());
    let source_folder = || folder_or_here(source).to_owned();
    let elsewhere = || BelowError::Elsewhere { path: path.to_owned(), source_folder: source_folder() };
    as_written().or_else(resolved).ok_or_else(elsewhere)
}

/// The folder, or `.` where its path is empty.
fn folder_or_here(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

fn stays_inside(path: &Path) -> bool {
    let depth = path.components().try_fold(0_usize, |depth, part| match part {
        Component::Normal(_) => Some(depth + 1),
        Component::CurDir => Some(depth),
        Component::ParentDir => depth.checked_sub(1),
        Component::Prefix(_) | Component::RootDir => None,
    });
    depth.is_some()
}

/// A path with forward slashes, as files state it on every system.
pub fn slashed(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

/// The deepest folder that contains all of these, with links resolved; absent if that is the root or a path is
/// missing.
pub fn common_folder<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Option<PathBuf> {
    let mut common: Option<PathBuf> = None;
    for path in paths {
        let path = path.canonicalize().ok()?;
        let mut folder = if path.is_dir() { path } else { path.parent()?.to_owned() };
        if let Some(common) = common {
            while !common.starts_with(&folder) {
                folder = folder.parent()?.to_owned();
            }
        }
        common = Some(folder);
    }
    common.filter(|folder| folder.parent().is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_inside() {
        for (name, relative) in [("models\\a b.obj", "models/a b.obj"), ("./a/../b.png", "b.png"), ("a..b", "a..b")] {
            assert_eq!(SourceFolder::relative(name).unwrap(), relative);
        }
        let address = SourceFolder::relative("https://example.org/a.png").unwrap_err();
        assert!(address.code == "path_escapes" && address.message.contains("is an address"), "{address}");
        for bad in ["../a", "a/../../b", "/etc/passwd", "C:\\a", "", "..", ".", "a/.."] {
            assert!(SourceFolder::relative(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn slashes_lean_forward() {
        assert_eq!(slashed(Path::new("a\\b c/d.png")), "a/b c/d.png");
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

    /// A folder with two folders.
    fn folders() -> (tempfile::TempDir, [PathBuf; 2]) {
        let root = tempfile::tempdir().unwrap();
        let both = ["houses", "models/one"].map(|name| root.path().join(name));
        both.iter().for_each(|folder| std::fs::create_dir_all(folder).unwrap());
        std::fs::write(both[0].join("a.json"), "{}").unwrap();
        (root, both)
    }

    #[test]
    fn paths_stay_below() {
        let (root, [houses, models]) = folders();
        for path in ["a", "a/../b", "./a", ".", ""] {
            assert_eq!(relative_below(Path::new(path), root.path()).unwrap(), Path::new(path));
        }
        for path in ["..", "a/../../b", "../a"] {
            let refused = relative_below(Path::new(path), root.path());
            assert_eq!(refused, Err(BelowError::LeadsOut { path: path.into() }));
        }
        assert_eq!(relative_below(&houses.join("a.json"), root.path()).unwrap(), Path::new("houses/a.json"));
        assert_eq!(relative_below(root.path(), root.path()).unwrap(), Path::new(""));
        let error = relative_below(&models, &houses).unwrap_err();
        assert_eq!(error, BelowError::Elsewhere { path: models, source_folder: houses.clone() });
        assert!(relative_below(&houses.join("../models"), &houses).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_resolved() {
        let (root, [houses, _]) = folders();
        let link = root.path().join("link");
        std::os::unix::fs::symlink(&houses, &link).unwrap();
        assert_eq!(relative_below(&link.join("a.json"), root.path()).unwrap(), Path::new("link/a.json"));
        assert_eq!(relative_below(&houses.join("a.json"), &link).unwrap(), Path::new("a.json"));
    }

    #[test]
    fn the_common_folder_is_the_deepest() {
        let (root, [houses, models]) = folders();
        let root = root.path().canonicalize().unwrap();
        assert_eq!(common_folder([houses.as_path(), &models]), Some(root.clone()));
        assert_eq!(common_folder([root.join("models").as_path(), &models]), Some(root.join("models")));
        assert_eq!(common_folder([houses.join("a.json").as_path(), &houses]), Some(root.join("houses")));
        assert_eq!(common_folder([houses.as_path(), Path::new("/")]), None);
        assert_eq!(common_folder([root.join("none").as_path()]), None);
    }
}
