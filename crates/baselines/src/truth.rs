//! `gt`, the ceiling: the ground truth baked to the atlases, as a submission.

use std::path::Path;

use mateval_scene::open::Dataset;
use mateval_scene::submission::Map;

use crate::error::BaselineError;
use crate::submission::{self, Method};

/// Copies the baked maps of every instance and returns the number of instances.
pub fn write(dataset: &Dataset, out: &Path, force: bool) -> Result<usize, BaselineError> {
    // A public tree is refused before anything is written.
    for scene in dataset.scenes.iter().filter(|scene| !dataset.folder(&scene.id).truth().exists()) {
        dataset.check_files(&scene.id, |path| path.starts_with("ground_truth/materials/"))?;
    }
    let method = Method::new("gt", "the true materials baked to the dataset's own atlases");
    submission::write(dataset, out, force, &method, &|_| (), |scene, instance, folder| {
        let truth = dataset.folder(&scene.id).truth_material(&instance.id);
        for map in Map::ALL {
            let name = Path::new(map.stem()).with_extension("png");
            let (from, to) = (truth.join(&name), folder.join(&name));
            let copied = std::fs::copy(&from, &to);
            copied.map_err(|source| BaselineError::Io { action: "copy", path: from, source })?;
        }
        Ok(())
    })
}
