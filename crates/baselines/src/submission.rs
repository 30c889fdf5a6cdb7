//! Writing a submission: whole or not at all.

use std::path::Path;

use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::open::Dataset;
use mateval_scene::submission::{SUBMISSION, SUBMISSION_FORMAT, SubmissionFile, scene_folder};
use mateval_scene::work_folder::{WorkFolder, check_free};
use mateval_scene::{SceneError, json};

use crate::error::BaselineError;

/// What `submission.json` says of a baseline.
#[derive(Clone, Debug)]
pub struct Method {
    /// As tables show it.
    pub name: String,
    /// Everything that was chosen.
    pub description: String,
}

impl Method {
    /// Of these words.
    pub fn new(name: &str, description: &str) -> Self {
        Self { name: name.to_owned(), description: description.to_owned() }
    }
}

/// Makes a submission at `out`: `write_instance` is called for every instance that has an atlas, with the folder that
/// its maps belong in. `force` replaces an earlier submission there. Gives the number of instances.
pub fn write(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    method: &Method,
    write_instance: impl Fn(&SceneFile, &Instance, &Path) -> Result<(), BaselineError>,
) -> Result<usize, BaselineError> {
    write_scenes(dataset, out, force, method, |scene, folder| {
        let mut instances = 0;
        for instance in scene.instances.iter().filter(|instance| instance.atlas.is_some()) {
            let folder = folder.join(instance.id.as_str());
            std::fs::create_dir_all(&folder).map_err(SceneError::io("make", &folder))?;
            write_instance(scene, instance, &folder)?;
            instances += 1;
        }
        Ok(instances)
    })
}

/// The same, scene by scene: `write_scene` is given the folder that its instances' folders belong in, and tells how
/// many it wrote.
pub fn write_scenes(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    method: &Method,
    write_scene: impl Fn(&SceneFile, &Path) -> Result<usize, BaselineError>,
) -> Result<usize, BaselineError> {
    check_outside(dataset, out)?;
    check_place(out, force)?;
    let work = WorkFolder::start(out)?;
    let mut instances = 0;
    for scene in &dataset.scenes {
        // A submission names the dataset that it was made for: what it is made of must be what that says.
        dataset.check_files(&scene.id, |path| !path.contains("/renders/"))?;
        let folder = scene_folder(work.path(), &scene.id);
        std::fs::create_dir_all(&folder).map_err(SceneError::io("make", &folder))?;
        instances += write_scene(scene, &folder)?;
    }
    let file = SubmissionFile {
        format: SUBMISSION_FORMAT.to_owned(),
        method: method.name.clone(),
        description: method.description.clone(),
        url: None,
        licence: None,
        cost: None,
        dataset_manifest_sha256: dataset.file.manifest_sha256.clone(),
    };
    json::write(&work.path().join(SUBMISSION), &file)?;
    work.finish()?;
    Ok(instances)
}

/// A place of its own for what bridges write: nothing is there yet, and it is not in the dataset.
pub(crate) fn check_new_place(dataset: &Dataset, out: &Path) -> Result<(), BaselineError> {
    check_outside(dataset, out)?;
    if out.exists() { Err(BaselineError::InTheWay(out.to_owned())) } else { Ok(()) }
}

/// What lies in a dataset's folder is a fault of the dataset.
fn check_outside(dataset: &Dataset, out: &Path) -> Result<(), BaselineError> {
    let found = |path: &Path| path.canonicalize().ok();
    let Some(root) = found(&dataset.root) else { return Ok(()) };
    let there = std::path::absolute(out).ok();
    let above = there.iter().flat_map(|path| path.ancestors()).find_map(found);
    match above {
        Some(above) if above.starts_with(&root) => Err(BaselineError::InDataset(out.to_owned())),
        _ => Ok(()),
    }
}

fn check_place(out: &Path, force: bool) -> Result<(), BaselineError> {
    check_free(out, force, "--out")?;
    if out.exists() && !out.join(SUBMISSION).exists() {
        return Err(BaselineError::NotASubmission(out.to_owned()));
    }
    Ok(())
}
