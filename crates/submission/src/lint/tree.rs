//! The names and kinds of the entries in a submission's folder, four levels deep; links that lead out are not followed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_scene::Finding;
use mateval_scene::findings::shortened;

use super::finding::error;
use crate::archive::MAX_ENTRIES;
use crate::error::SubmissionError;

/// How deep maps lie: `scenes/<scene>/<instance>/<map>`.
const DEPTH: usize = 4;

/// The kind of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    File,
    Folder,
    /// Leads nowhere, or out of the folder.
    BadLink,
    /// A pipe, a device.
    Other,
}

/// Entries by their path, relative to the submission, with forward slashes.
pub(super) struct Tree {
    entries: BTreeMap<String, Kind>,
}

impl Tree {
    /// Lists the folder. Names that are not UTF-8 and entries beyond the limit are findings.
    pub(super) fn walk(root: &Path) -> Result<(Self, Vec<Finding>), SubmissionError> {
        let real = root.canonicalize().map_err(SubmissionError::io("open", root))?;
        let (mut tree, mut findings) = (Self { entries: BTreeMap::new() }, Vec::new());
        let mut folders = vec![(String::new(), 1)];
        while let Some((folder, depth)) = folders.pop() {
            let path = real.join(&folder);
            for entry in std::fs::read_dir(&path).map_err(SubmissionError::io("list", &path))? {
                let entry = entry.map_err(SubmissionError::io("list", &path))?;
                if tree.entries.len() == MAX_ENTRIES {
                    let message = format!("more than {MAX_ENTRIES} files and folders; the rest was not checked");
                    findings.push(error("too_many_files", &folder, message, "keep submission.json and the maps only"));
                    return Ok((tree, findings));
                }
                let Some(name) = entry.file_name().to_str().map(|name| joined(&folder, name)) else {
                    let name = shortened(&entry.file_name().to_string_lossy());
                    findings.push(error("bad_name", &joined(&folder, &name), "a name that is not UTF-8", "rename it"));
                    continue;
                };
                let kind = kind_of(&real, &entry.path());
                if kind == Kind::Folder && depth < DEPTH {
                    folders.push((name.clone(), depth + 1));
                }
                tree.entries.insert(name, kind);
            }
        }
        Ok((tree, findings))
    }

    /// The kind of the entry at a path.
    pub(super) fn kind(&self, path: &str) -> Option<Kind> {
        self.entries.get(path).copied()
    }

    /// Names and kinds of the entries in a folder, sorted; an empty path is the submission's own folder.
    pub(super) fn children<'a>(&'a self, folder: &str) -> impl Iterator<Item = (&'a str, Kind)> + use<'a> {
        let prefix = if folder.is_empty() { String::new() } else { format!("{folder}/") };
        let length = prefix.len();
        let below = self.entries.range(prefix.clone()..).take_while(move |(path, _)| path.starts_with(&prefix));
        below.filter_map(move |(path, kind)| (!path[length..].contains('/')).then_some((&path[length..], *kind)))
    }
}

/// A name in a folder.
pub(super) fn joined(folder: &str, name: &str) -> String {
    if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") }
}

/// The kind of an entry; a link that stays inside the folder has the kind of its target.
fn kind_of(root: &Path, path: &Path) -> Kind {
    let is_link = path.symlink_metadata().is_ok_and(|data| data.is_symlink());
    let place: Option<PathBuf> = if is_link { path.canonicalize().ok() } else { Some(path.to_owned()) };
    let Some(place) = place.filter(|place| place.starts_with(root)) else { return Kind::BadLink };
    match place.metadata() {
        Ok(data) if data.is_file() => Kind::File,
        Ok(data) if data.is_dir() => Kind::Folder,
        _ => Kind::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_ends_after_four_levels() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("scenes/s/i/deep/deeper")).unwrap();
        std::fs::write(folder.path().join("scenes/s/i/a.png"), "").unwrap();
        std::fs::write(folder.path().join("scenes/s/i/deep/b.png"), "").unwrap();
        let (tree, findings) = Tree::walk(folder.path()).unwrap();
        assert_eq!(findings, Vec::new());
        let inside: Vec<_> = tree.children("scenes/s/i").collect();
        assert_eq!(inside, [("a.png", Kind::File), ("deep", Kind::Folder)]);
        assert_eq!((tree.children("").count(), tree.kind("scenes/s/i/deep/b.png")), (1, None));
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_are_not_followed_and_loops_end() {
        let (folder, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let link = |to: &Path, name: &str| std::os::unix::fs::symlink(to, folder.path().join(name)).unwrap();
        link(outside.path(), "out");
        link(Path::new("nowhere"), "broken");
        link(folder.path(), "loop");
        let (tree, _) = Tree::walk(folder.path()).unwrap();
        let kinds = ["out", "broken", "loop", "loop/loop/loop/out"].map(|name| tree.kind(name));
        assert_eq!(kinds, [Kind::BadLink, Kind::BadLink, Kind::Folder, Kind::BadLink].map(Some));
        assert_eq!(tree.kind("loop/loop/loop/loop/loop"), None);
    }
}
