//! Folders that are there whole or not at all.

use std::path::{Path, PathBuf};

use crate::SceneError;

/// A folder under work beside its place; [`WorkFolder::finish`] renames it there.
#[derive(Debug)]
pub struct WorkFolder {
    place: PathBuf,
    work: PathBuf,
}

impl WorkFolder {
    /// Starts anew: what an earlier, killed run left beside `place` is removed.
    pub fn start(place: &Path) -> Result<Self, SceneError> {
        let mut name = std::ffi::OsString::from(".");
        name.push(place.file_name().unwrap_or_default());
        name.push(".partial");
        let work = place.with_file_name(name);
        remove(&work)?;
        std::fs::create_dir_all(&work).map_err(SceneError::io("make", &work))?;
        Ok(Self { place: place.to_owned(), work })
    }

    /// Where to write until it is finished.
    pub fn path(&self) -> &Path {
        &self.work
    }

    /// Moves the folder to its place, replacing what is there.
    pub fn finish(self) -> Result<(), SceneError> {
        remove(&self.place)?;
        std::fs::rename(&self.work, &self.place).map_err(SceneError::io("rename to", &self.place))
    }
}

fn remove(path: &Path) -> Result<(), SceneError> {
    match std::fs::remove_dir_all(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(SceneError::io("remove", path)(error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_at_the_place_until_it_is_finished() {
        let root = tempfile::tempdir().unwrap();
        let place = root.path().join("out");
        let killed = WorkFolder::start(&place).unwrap();
        std::fs::write(killed.path().join("old"), "x").unwrap();
        drop(killed);
        assert!(!place.exists());
        let folder = WorkFolder::start(&place).unwrap();
        std::fs::write(folder.path().join("new"), "x").unwrap();
        folder.finish().unwrap();
        let names: Vec<_> = std::fs::read_dir(&place).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(names, ["new"]);
        assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 1);
    }
}
