//! A folder in which a leaderboard's results are collected, for example by pull requests.
//!
//! `ceiling.json` and `errata.json` lie in the folder itself. Every other `.json` file, there or in a folder directly
//! below it (for example one for each method), is a result or, if it ends in `.verified.json`, the verification of one.

use std::path::{Path, PathBuf};

use mateval_scene::SceneError;

use crate::error::ReportError;

/// The file of the truth's own result.
const CEILING: &str = "ceiling.json";

/// The file of errors that were found after publication.
const ERRATA: &str = "errata.json";

/// The files of a folder of results.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ResultsFolder {
    /// The files of the methods' results, sorted; at least one if the folder was listed.
    pub results: Vec<PathBuf>,
    /// The file of the truth's result.
    pub ceiling: Option<PathBuf>,
    /// The file of the errata.
    pub errata: Option<PathBuf>,
}

impl ResultsFolder {
    /// Lists the folder. Fails where it holds no result, and where one of its `.json` files is a link, which could lead
    /// out of the folder.
    pub fn list(folder: &Path) -> Result<Self, ReportError> {
        let mut found = Self::default();
        let mut folders = Vec::new();
        for (path, kind) in entries(folder)? {
            match path.file_name().and_then(|name| name.to_str()) {
                _ if kind.is_dir() => folders.push(path),
                Some(CEILING) => found.ceiling = Some(file(path, kind)?),
                Some(ERRATA) => found.errata = Some(file(path, kind)?),
                name => found.add(name, path.clone(), kind)?,
            }
        }
        for folder in folders {
            for (path, kind) in entries(&folder)? {
                found.add(path.file_name().and_then(|name| name.to_str()), path.clone(), kind)?;
            }
        }
        if found.results.is_empty() {
            return Err(ReportError::NoResultsBelow { folder: folder.to_owned() });
        }
        found.results.sort();
        Ok(found)
    }

    /// Adds the file if its name is that of a result. Fails where it or a verification is a link.
    fn add(&mut self, name: Option<&str>, path: PathBuf, kind: std::fs::FileType) -> Result<(), ReportError> {
        let Some(name) = name.filter(|name| name.ends_with(".json") && !kind.is_dir()) else { return Ok(()) };
        let path = file(path, kind)?;
        if !name.ends_with(".verified.json") {
            self.results.push(path);
        }
        Ok(())
    }
}

/// The entries of a folder with their types; a link is not followed.
fn entries(folder: &Path) -> Result<Vec<(PathBuf, std::fs::FileType)>, SceneError> {
    let entry = |entry: std::io::Result<std::fs::DirEntry>| {
        let entry = entry?;
        Ok((entry.path(), entry.file_type()?))
    };
    let all = folder.read_dir().and_then(|entries| entries.map(entry).collect());
    all.map_err(SceneError::io("list", folder))
}

/// The path, if it is a regular file's.
fn file(path: PathBuf, kind: std::fs::FileType) -> Result<PathBuf, ReportError> {
    if kind.is_file() { Ok(path) } else { Err(ReportError::NotAFile { path }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "{}").unwrap();
        }
        folder
    }

    #[test]
    fn results_are_found_by_their_place() {
        let files = [
            "b.json",
            "ceiling.json",
            "errata.json",
            "README.md",
            "a/RESULT.json",
            "a/RESULT.verified.json",
            "a/errata.json",
            "c/notes.txt",
            "c/deep/RESULT.json",
        ];
        let folder = folder(&files);
        let found = ResultsFolder::list(folder.path()).unwrap();
        let at = |name: &str| folder.path().join(name);
        assert_eq!(found.results, ["a/RESULT.json", "a/errata.json", "b.json"].map(at));
        assert_eq!((found.ceiling, found.errata), (Some(at("ceiling.json")), Some(at("errata.json"))));
    }

    #[test]
    fn a_folder_without_results_and_links_are_refused() {
        let no_result = folder(&["ceiling.json", "a/RESULT.verified.json"]);
        let refused = ResultsFolder::list(no_result.path());
        assert!(matches!(refused, Err(ReportError::NoResultsBelow { .. })), "{refused:?}");
        let with_link = folder(&["a/RESULT.json", "b/notes.txt"]);
        for name in ["b/RESULT.json", "a/RESULT.verified.json"] {
            assert_eq!(ResultsFolder::list(with_link.path()).unwrap().results.len(), 1);
            std::os::unix::fs::symlink("/etc/passwd", with_link.path().join(name)).unwrap();
            let refused = ResultsFolder::list(with_link.path());
            assert!(matches!(refused, Err(ReportError::NotAFile { .. })), "{refused:?}");
            std::fs::remove_file(with_link.path().join(name)).unwrap();
        }
        assert!(ResultsFolder::list(&with_link.path().join("none")).is_err());
    }
}
