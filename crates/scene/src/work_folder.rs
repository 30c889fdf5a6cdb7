//! Outputs: whether they may be written, and folders that appear whole or not at all.

use std::path::{Path, PathBuf};

use crate::SceneError;

/// Fails where the output `path` exists and `force` does not allow replacing it. `place` is the argument of the command
/// that names the output, as in `--out`.
pub fn check_free(path: &Path, force: bool, place: &'static str) -> Result<(), SceneError> {
    if force || !path.exists() { Ok(()) } else { Err(SceneError::Exists { path: path.to_owned(), place }) }
}

/// A folder that is filled beside its place. [`WorkFolder::finish`] moves it there, dropping it removes it.
#[derive(Debug)]
pub struct WorkFolder {
    place: PathBuf,
    work: PathBuf,
}

impl WorkFolder {
    /// Starts an empty folder, after removing what a killed run left. Fails for a place without a name, as in `.` or
    /// `/`.
    pub fn start(place: &Path) -> Result<Self, SceneError> {
        let work = beside(place, "partial")?;
        remove(&work)?;
        std::fs::create_dir_all(&work).map_err(SceneError::io("make", &work))?;
        Ok(Self { place: place.to_owned(), work })
    }

    /// The folder to fill.
    pub fn path(&self) -> &Path {
        &self.work
    }

    /// Moves the folder to its place. A folder that exists there is put aside first and removed last.
    pub fn finish(self) -> Result<(), SceneError> {
        put_aside(&self.place)?;
        std::fs::rename(&self.work, &self.place).map_err(SceneError::io("rename to", &self.place))?;
        remove(&beside(&self.place, "old")?)
    }
}

impl Drop for WorkFolder {
    fn drop(&mut self) {
        // After `finish` it no longer exists; if it cannot be removed after an error, the next start tries again.
        let _ = remove(&self.work);
    }
}

/// Renames a folder, if it exists, to `.NAME.old` beside it, which frees its place at once. [`remove_aside`] deletes
/// it.
pub fn put_aside(place: &Path) -> Result<(), SceneError> {
    let old = beside(place, "old")?;
    remove(&old)?;
    match std::fs::rename(place, &old) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(SceneError::io("put aside", place)(error)),
        _ => Ok(()),
    }
}

/// Deletes the folder that [`put_aside`] renamed.
pub fn remove_aside(place: &Path) -> Result<(), SceneError> {
    remove(&beside(place, "old")?)
}

/// `.NAME.ending` beside `NAME`.
fn beside(place: &Path, ending: &str) -> Result<PathBuf, SceneError> {
    let Some(name) = place.file_name() else {
        let what = "a folder without a name; name the folder to be made".to_owned();
        return Err(SceneError::Unsupported { path: place.to_owned(), what });
    };
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(".");
    hidden.push(ending);
    Ok(place.with_file_name(hidden))
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
        // What a killed run leaves.
        std::fs::create_dir(root.path().join(".out.partial")).unwrap();
        std::fs::write(root.path().join(".out.partial/old"), "x").unwrap();
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
