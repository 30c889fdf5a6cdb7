//! The bridge to PartField (Liu and others, "PartField: Learning 3D Feature Fields for Part Segmentation and Beyond",
//! 2025), which splits one mesh at a time into parts.
//!
//! [`export`] writes the meshes. [`import`] copies PartField's labels to where `part_labels` in a recipe expects them; a
//! dataset built from that recipe has a second part set.

use std::path::{Path, PathBuf};

use mateval_image::store::write_whole;
use mateval_scene::dataset::Instance;
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::WorkFolder;
use mateval_scene::{SceneError, SceneId};

use crate::error::{BaselineError, LabelsError};
use crate::geometry::SceneGeometry;
use crate::objects::{obj_text, object_id};
use crate::submission::check_new_place;

/// Largest file of labels that is read, in bytes.
const MAX_LABEL_BYTES: u64 = 1 << 28;

/// Writes `<id>.obj` for every instance that has an atlas, and returns their number.
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

/// Copies `<id>_0_<parts>.npy`, PartField's labels of an instance that is split into `parts` parts, from `clusters` to
/// `<scene>/<instance>.npy`. PartField writes no such file for an instance with fewer triangles than parts; the file with
/// the next smaller number of parts is taken then. An instance without any such file keeps its own parts. Returns the
/// number of instances with labels.
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

/// The file's bytes, if it holds one label per triangle.
fn checked_labels(path: &Path, instance: &Instance) -> Result<Vec<u8>, BaselineError> {
    let bad = |source: LabelsError| BaselineError::BadLabels { path: path.to_owned(), source };
    let bytes = mateval_image::limits::read_at_most(path, MAX_LABEL_BYTES).map_err(|error| bad(error.into()))?;
    let file = npyz::NpyFile::new(bytes.as_slice()).map_err(|error| bad(error.into()))?;
    let labels: u64 = file.shape().iter().try_fold(1_u64, |all, axis| all.checked_mul(*axis)).unwrap_or(u64::MAX);
    if labels != instance.triangles as u64 {
        let (instance, triangles) = (instance.id.to_string(), instance.triangles);
        return Err(bad(LabelsError::Count { labels, instance, triangles }));
    }
    Ok(bytes)
}
