//! Writing a submission: whole or not at all.

use std::path::{Path, PathBuf};

use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::open::Dataset;
use mateval_scene::submission::{SUBMISSION, SUBMISSION_FORMAT, SubmissionFile, instance_folder};
use mateval_scene::work_folder::WorkFolder;
use mateval_scene::{SceneError, json};

use crate::error::BaselineError;

/// Makes a submission at `out`: `write_instance` is called for every instance that has an atlas, with the folder that its
/// maps belong in. `force` replaces an earlier submission there. Gives the number of instances.
pub fn write(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    method: &str,
    description: &str,
    write_instance: impl Fn(&SceneFile, &Instance, &Path) -> Result<(), BaselineError>,
) -> Result<usize, BaselineError> {
    check_place(out, force)?;
    let work = WorkFolder::start(out)?;
    let mut instances = 0;
    for scene in &dataset.scenes {
        for instance in scene.instances.iter().filter(|instance| instance.atlas.is_some()) {
            let folder = instance_folder(work.path(), &scene.id, &instance.id);
            std::fs::create_dir_all(&folder).map_err(SceneError::io("make", &folder))?;
            write_instance(scene, instance, &folder)?;
            instances += 1;
        }
    }
    let file = SubmissionFile {
        format: SUBMISSION_FORMAT.to_owned(),
        method: method.to_owned(),
        description: description.to_owned(),
        dataset_manifest_sha256: dataset.file.manifest_sha256.clone(),
    };
    json::write(&work.path().join(SUBMISSION), &file)?;
    work.finish()?;
    Ok(instances)
}

fn check_place(out: &Path, force: bool) -> Result<(), BaselineError> {
    let there: PathBuf = out.to_owned();
    match (out.exists(), force, out.join(SUBMISSION).exists()) {
        (false, _, _) | (true, true, true) => Ok(()),
        (true, false, _) => Err(BaselineError::Exists(there)),
        (true, true, false) => Err(BaselineError::NotASubmission(there)),
    }
}
