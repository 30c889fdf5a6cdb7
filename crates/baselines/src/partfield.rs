//! The bridge to PartField (Liu and others, "PartField: Learning 3D Feature Fields for Part Segmentation and Beyond",
//! 2025), which splits one mesh at a time into parts.
//!
//! [`export`] writes the meshes, [`import`] names the labels that it made as a recipe's `part_labels` wants them: built
//! anew with these, the dataset has a second set of parts.

use std::path::{Path, PathBuf};

use mateval_image::store::write_whole;
use mateval_scene::dataset::Instance;
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::WorkFolder;
use mateval_scene::{SceneError, SceneId};

use crate::error::BaselineError;
use crate::geometry::SceneGeometry;
use crate::objects::{obj_text, object_id};
use crate::submission::check_new_place;

/// Largest file of labels that is read.
const MAX_LABEL_BYTES: u64 = 1 << 28;

/// Writes `<id>.obj` for every instance that has an atlas. Gives how many there are.
pub fn export(dataset: &Dataset, out: &Path) -> Result<usize, BaselineError> {
    check_new_place(dataset, out)?;
    let work = WorkFolder::start(out)?;
    let mut count = 0;
    for scene in &dataset.scenes {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        for (at, instance) in scene.instances.iter().enumerate().filter(|(_, instance)| instance.atlas.is_some()) {
            let path = work.path().join(object_id(&scene.id, instance)).with_extension("obj");
            write_whole(&path, obj_text(geometry.mesh(at)).as_bytes())?;
            count += 1;
        }
    }
    work.finish()?;
    Ok(count)
}

/// Copies the labels of `parts` parts an instance, `<id>_0_<parts>.npy` in `clusters` as PartField names them, to
/// `<scene>/<instance>.npy`. Where an instance has fewer triangles than that PartField writes no such file: the one of
/// the most parts below is taken. Instances without any keep their own parts. Gives how many have labels.
pub fn import(dataset: &Dataset, clusters: &Path, parts: u8, out: &Path) -> Result<usize, BaselineError> {
    check_new_place(dataset, out)?;
    let work = WorkFolder::start(out)?;
    let mut count = 0;
    for scene in &dataset.scenes {
        let folder = work.path().join(scene.id.as_str());
        std::fs::create_dir_all(&folder).map_err(SceneError::io("make", &folder))?;
        for instance in &scene.instances {
            let Some(path) = labels_of(clusters, &scene.id, instance, parts) else { continue };
            let bytes = checked_labels(&path, instance)?;
            write_whole(&folder.join(instance.id.as_str()).with_extension("npy"), &bytes)?;
            count += 1;
        }
    }
    if count == 0 {
        return Err(BaselineError::NoLabels { folder: clusters.to_owned(), parts });
    }
    work.finish()?;
    Ok(count)
}

fn labels_of(clusters: &Path, scene: &SceneId, instance: &Instance, parts: u8) -> Option<PathBuf> {
    let id = object_id(scene, instance);
    let mut candidates = (1..=parts).rev().map(|count| clusters.join(format!("{id}_0_{count:02}.npy")));
    candidates.find(|path| path.is_file())
}

/// The file's bytes, where it holds one label a triangle.
fn checked_labels(path: &Path, instance: &Instance) -> Result<Vec<u8>, BaselineError> {
    let bad = |what: String| BaselineError::BadLabels { path: path.to_owned(), what };
    let bytes = mateval_image::limits::read_at_most(path, MAX_LABEL_BYTES).map_err(|error| bad(error.to_string()))?;
    let file = npyz::NpyFile::new(bytes.as_slice()).map_err(|error| bad(error.to_string()))?;
    let labels: u64 = file.shape().iter().try_fold(1_u64, |all, axis| all.checked_mul(*axis)).unwrap_or(u64::MAX);
    if labels != instance.triangles as u64 {
        let what = format!("{labels} labels; '{}' has {} triangles", instance.id, instance.triangles);
        return Err(bad(what));
    }
    Ok(bytes)
}
