//! Writes a submission, complete or not at all.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::dataset::{Instance, SceneFile};
use mateval_dataset::layout::is_rendered;
use mateval_dataset::open::{Dataset, check_outside};
use mateval_dataset::submission::{Map, SUBMISSION, SUBMISSION_FORMAT, StoredEncoding, SubmissionFile, scene_folder};
use mateval_dataset::{Progress, Report, json};
use mateval_files::work_folder::{WorkFolder, check_free, make_folder};

use crate::error::BaselineError;

/// Name and description of a baseline in `submission.json`.
#[derive(Clone, Debug)]
pub struct Method {
    pub name: String,
    /// All choices that were made.
    pub description: String,
    /// By map, the encodings that an adapter assumed.
    pub assumed_encodings: BTreeMap<Map, StoredEncoding>,
    /// Whether it reads the ground truth.
    pub is_oracle: bool,
}

impl Method {
    /// A method with this name and description, which assumes no encodings.
    pub fn new(name: &str, description: &str) -> Self {
        let (name, description) = (name.to_owned(), description.to_owned());
        Self { name, description, assumed_encodings: BTreeMap::new(), is_oracle: false }
    }
}

/// A baseline that needs a dataset and no options.
pub struct Baseline {
    /// The word of the command line.
    pub name: &'static str,
    /// A line for the command's help.
    pub about: &'static str,
    /// Writes the submission to a folder and returns the number of instances. With `force` it replaces an earlier one.
    pub write: fn(&Dataset, &Path, bool) -> Result<usize, BaselineError>,
}

/// Writes a submission to `out` and returns the number of instances. `write_instance` is called for every instance that
/// has an atlas, with the folder for its maps. `force` replaces an earlier submission.
pub fn write(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    method: &Method,
    write_instance: impl Fn(&SceneFile, &Instance, &Path) -> Result<(), BaselineError>,
) -> Result<usize, BaselineError> {
    write_scenes(dataset, out, force, method, &|_| (), |scene, folder| {
        let mut instances = 0;
        for instance in scene.instances.iter().filter(|instance| instance.atlas.is_some()) {
            let folder = folder.join(instance.id.as_str());
            make_folder(&folder)?;
            write_instance(scene, instance, &folder)?;
            instances += 1;
        }
        Ok(instances)
    })
}

/// Writes a submission scene by scene: `write_scene` receives the folder for its instances' folders and returns the
/// number of instances that it wrote.
pub fn write_scenes(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    method: &Method,
    progress: Progress<'_>,
    mut write_scene: impl FnMut(&SceneFile, &Path) -> Result<usize, BaselineError>,
) -> Result<usize, BaselineError> {
    check_out(dataset, out, force)?;
    let work = WorkFolder::start(out)?;
    let mut instances = 0;
    for (at, scene) in dataset.scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, dataset.scenes.len()));
        // The submission names the dataset by its manifest, so the files that it is made from must match the manifest.
        // Where the ground truth is withheld, only public files are checked: what reads the truth reports its absence.
        let has_truth = dataset.folder(&scene.id).truth().exists();
        let concerns = |path: &str| !is_rendered(path) && (has_truth || !path.starts_with("ground_truth/"));
        dataset.check_files(&scene.id, concerns)?;
        let folder = scene_folder(work.path(), &scene.id);
        make_folder(&folder)?;
        instances += write_scene(scene, &folder)?;
    }
    let file = SubmissionFile {
        format: SUBMISSION_FORMAT.to_owned(),
        method: method.name.clone(),
        description: method.description.clone(),
        url: None,
        licence: None,
        cost: None,
        trained_on: Vec::new(),
        oracle: method.is_oracle,
        assumed_encodings: method.assumed_encodings.clone(),
        geometry: dataset.file.perturbation(),
        dataset_manifest_sha256: dataset.file.scored_manifest_sha256().to_owned(),
    };
    json::write(&work.path().join(SUBMISSION), &file)?;
    work.finish()?;
    Ok(instances)
}

/// Fails where a submission may not be written to `out`: in the dataset's folder, or where something exists that
/// `force` does not allow replacing, or that is no submission.
pub fn check_out(dataset: &Dataset, out: &Path, force: bool) -> Result<(), BaselineError> {
    check_outside(out, &dataset.root, "--out")?;
    check_free(out, force, "--out")?;
    if out.exists() && !out.join(SUBMISSION).exists() {
        let why = "exists and holds no submission.json, so it is not replaced; choose another --out";
        return Err(BaselineError::unusable(out, why));
    }
    Ok(())
}

/// Fails where files for another project would replace something or lie in the dataset.
pub(crate) fn check_new_place(dataset: &Dataset, out: &Path) -> Result<(), BaselineError> {
    check_outside(out, &dataset.root, "--out")?;
    match out.exists() {
        true => Err(BaselineError::unusable(out, "already exists; choose another --out")),
        false => Ok(()),
    }
}
