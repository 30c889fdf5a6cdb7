//! Folders that appear whole or not at all, and whether an output may be written.

use std::path::{Path, PathBuf};

use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

use crate::error::FileError;
use crate::whole;

/// Fails where the output `path` exists and `force` does not allow replacing it. `place` is the argument of the command
/// that names the output, as in `--out`.
pub fn check_free(path: &Path, force: bool, place: &'static str) -> Result<(), FileError> {
    if force || !path.exists() { Ok(()) } else { Err(FileError::Exists { path: path.to_owned(), place }) }
}

/// Whether `out`, which need not exist, would lie in `folder`, also by way of links.
pub fn is_inside(out: &Path, folder: &Path) -> bool {
    let Ok(folder) = folder.canonicalize() else { return false };
    let out = std::path::absolute(out).ok();
    // The nearest ancestor that exists; the folders below it are yet to be made.
    let above = out.iter().flat_map(|path| path.ancestors()).find_map(|path| path.canonicalize().ok());
    above.is_some_and(|above| above.starts_with(&folder))
}

/// Fails where one of the inputs lies in `out`, or is it: replacing `out` would delete it.
pub fn check_holds_none(out: &Path, inputs: &[&Path]) -> Result<(), FileError> {
    let Ok(place) = out.canonicalize() else { return Ok(()) };
    let is_held = |input: &&&Path| input.canonicalize().is_ok_and(|input| input.starts_with(&place));
    match inputs.iter().find(is_held) {
        None => Ok(()),
        Some(input) => Err(FileError::HoldsInput { path: out.to_owned(), input: input.to_path_buf() }),
    }
}

/// Makes the folder and those above it that do not exist.
pub fn make_folder(path: &Path) -> Result<(), FileError> {
    std::fs::create_dir_all(path).map_err(FileError::io("make", path))
}

/// A folder that is filled beside its place. [`WorkFolder::finish`] moves it there, dropping it removes it.
#[derive(Debug)]
pub struct WorkFolder {
    place: PathBuf,
    work: PathBuf,
    replaces: bool,
}

impl WorkFolder {
    /// Starts an empty folder, after removing what killed runs left. Fails for a place without a name, as in `.` or
    /// `/`.
    pub fn start(place: &Path) -> Result<Self, FileError> {
        remove_abandoned(place)?;
        let work = beside(place)?;
        make_folder(&work)?;
        Ok(Self { place: place.to_owned(), work, replaces: place.exists() })
    }

    /// The folder to fill.
    pub fn path(&self) -> &Path {
        &self.work
    }

    /// Moves the folder to its place, in exchange for the folder that was there at the start, which is removed. Fails
    /// where another process has made a folder there meanwhile.
    pub fn finish(self) -> Result<(), FileError> {
        let failed = |error: Errno| FileError::io("rename to", &self.place)(error.into());
        // A rename replaces an empty folder and never a full one.
        match (std::fs::rename(&self.work, &self.place), self.replaces) {
            (Ok(()), _) => Ok(()),
            (Err(_), true) => match renameat_with(CWD, &self.work, CWD, &self.place, RenameFlags::EXCHANGE) {
                // The old one lies at the place of work now, and is removed with it.
                Ok(()) => Ok(()),
                // Network file systems often have no exchange.
                Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => {
                    let old = put_aside(&self.place)?;
                    if let Err(source) = std::fs::rename(&self.work, &self.place) {
                        // Otherwise the next start would remove it as abandoned.
                        let _ = old.map(|old| std::fs::rename(old, &self.place));
                        return Err(FileError::io("rename to", &self.place)(source));
                    }
                    old.map_or(Ok(()), |old| remove(&old))
                }
                Err(error) => Err(failed(error)),
            },
            (Err(_), false) if self.place.exists() => Err(FileError::MadeMeanwhile { path: self.place.clone() }),
            (Err(source), false) => Err(FileError::io("rename to", &self.place)(source)),
        }
    }
}

impl Drop for WorkFolder {
    fn drop(&mut self) {
        // If it cannot be removed after an error, a later start tries again.
        let _ = remove(&self.work);
    }
}

/// Renames a folder, if it exists, to an unused name beside it, which frees its place at once. Returns that name, for
/// [`remove`].
pub fn put_aside(place: &Path) -> Result<Option<PathBuf>, FileError> {
    let old = beside(place)?;
    match std::fs::rename(place, &old) {
        Ok(()) => Ok(Some(old)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(FileError::io("put aside", place)(error)),
    }
}

/// Removes what killed runs left beside the folder: unfinished ones, and those that were put aside.
pub fn remove_abandoned(place: &Path) -> Result<(), FileError> {
    whole::abandoned_beside(place).iter().try_for_each(|path| remove(path))
}

/// Removes all unfinished folders beside the place, for a caller who alone may write there.
pub fn remove_beside(place: &Path) -> Result<(), FileError> {
    whole::all_beside(place).iter().try_for_each(|path| remove(path))
}

/// Removes a folder or file with all that is in it; does nothing where there is none.
pub fn remove(path: &Path) -> Result<(), FileError> {
    let is_folder = std::fs::symlink_metadata(path).is_ok_and(|found| found.is_dir());
    match if is_folder { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) } {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(FileError::io("remove", path)(error)),
        _ => Ok(()),
    }
}

fn beside(place: &Path) -> Result<PathBuf, FileError> {
    whole::beside(place).ok_or_else(|| FileError::Nameless { path: place.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::owner::Owner;

    #[test]
    fn nothing_is_at_the_place_until_it_is_finished() {
        let root = tempfile::tempdir().unwrap();
        let place = root.path().join("out");
        // What a killed run leaves.
        let mut ended = std::process::Command::new("true").spawn().unwrap();
        ended.wait().unwrap();
        let left = root.path().join(format!(".out.{}-{}-1-0.partial", Owner::this_process().host, ended.id()));
        std::fs::create_dir(&left).unwrap();
        std::fs::write(left.join("old"), "x").unwrap();
        std::fs::create_dir(&place).unwrap();
        std::fs::write(place.join("older"), "x").unwrap();
        let folder = WorkFolder::start(&place).unwrap();
        std::fs::write(folder.path().join("new"), "x").unwrap();
        assert!(place.join("older").exists());
        folder.finish().unwrap();
        let names: Vec<_> = std::fs::read_dir(&place).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(names, ["new"]);
        assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 1);
    }

    #[test]
    fn of_two_at_once_each_stays_whole() {
        let root = tempfile::tempdir().unwrap();
        let place = root.path().join("out");
        let make = |name: &str| {
            let folder = WorkFolder::start(&place).unwrap();
            std::fs::write(folder.path().join(name), "x").unwrap();
            folder
        };
        let names = || std::fs::read_dir(&place).unwrap().map(|entry| entry.unwrap().file_name()).collect::<Vec<_>>();
        let (first, second) = (make("first"), make("second"));
        first.finish().unwrap();
        let text = second.finish().unwrap_err().to_string();
        assert!(text.contains("was made by another process meanwhile"), "{text}");
        assert_eq!(names(), ["first"]);
        let (third, fourth) = (make("third"), make("fourth"));
        third.finish().unwrap();
        fourth.finish().unwrap();
        assert_eq!(names(), ["fourth"]);
        assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 1);
    }

    #[test]
    fn an_output_lies_in_a_folder_also_by_a_link_and_before_it_exists() {
        let root = tempfile::tempdir().unwrap();
        let [folder, other, link] = ["folder", "other", "link"].map(|name| root.path().join(name));
        std::fs::create_dir(&folder).unwrap();
        std::fs::create_dir(&other).unwrap();
        std::os::unix::fs::symlink(&folder, &link).unwrap();
        for inside in [folder.clone(), folder.join("a/b"), link.join("a"), other.join("../folder/a")] {
            assert!(is_inside(&inside, &folder), "{}", inside.display());
        }
        for outside in [root.path().to_owned(), other.join("a"), root.path().join("folder2")] {
            assert!(!is_inside(&outside, &folder), "{}", outside.display());
        }
    }

    #[test]
    fn what_holds_an_input_is_not_replaced() {
        let root = tempfile::tempdir().unwrap();
        let [out, input] = ["out", "out/deep/input"].map(|name| root.path().join(name));
        std::fs::create_dir_all(&input).unwrap();
        let text = check_holds_none(&out, &[root.path(), &input]).unwrap_err().to_string();
        assert!(text.contains("deep/input', which would be deleted"), "{text}");
        assert!(check_holds_none(&out, &[&out]).is_err());
        check_holds_none(&input, &[&out]).unwrap();
        check_holds_none(&root.path().join("new"), &[&input]).unwrap();
    }

    #[test]
    fn what_exists_is_overwritten_with_force_alone() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        assert!(check_free(&out, false, "--out").is_ok());
        std::fs::write(&out, "x").unwrap();
        assert!(check_free(&out, true, "--out").is_ok());
        let text = check_free(&out, false, "--out").unwrap_err().to_string();
        assert!(text.ends_with("out' already exists; choose another --out, or add --force to overwrite it"), "{text}");
    }

    #[test]
    fn an_error_leaves_nothing_and_a_nameless_place_is_refused() {
        let root = tempfile::tempdir().unwrap();
        drop(WorkFolder::start(&root.path().join("out")).unwrap());
        assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 0);
        assert!(WorkFolder::start(Path::new(".")).is_err());
    }
}
