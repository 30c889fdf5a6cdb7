//! Makes paths relative to the source's folder, since a dataset must not record the folders of the machine that made
//! it.

use std::path::{Component, Path, PathBuf};

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

/// The deepest folder that contains all of these, with links resolved; none where that is the root or a path is
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
