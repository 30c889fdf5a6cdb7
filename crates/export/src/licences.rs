//! The scenes' licences, which every export carries.

use std::path::Path;

use mateval_scene::SceneId;
use mateval_scene::open::Dataset;

use crate::error::ExportError;
use crate::write_file::write_file;

/// The licence texts of a scene, each after the name of its file in the source; none where the dataset states none.
pub fn text(dataset: &Dataset, scene: &SceneId) -> Option<String> {
    let own = dataset.file.licences.iter().filter(|licence| licence.scene == *scene);
    let texts: Vec<String> = own.map(|licence| format!("{}:\n\n{}\n", licence.file, licence.text.trim_end())).collect();
    (!texts.is_empty()).then(|| texts.join("\n"))
}

/// Writes the licence of a scene to `path`; writes nothing where the dataset states none.
pub fn write_one(dataset: &Dataset, scene: &SceneId, path: &Path) -> Result<(), ExportError> {
    text(dataset, scene).map_or(Ok(()), |text| write_file(path, text.as_bytes()))
}

/// Writes `licences/<scene>.txt` for every scene that has a licence.
pub fn write_all(dataset: &Dataset, out: &Path) -> Result<(), ExportError> {
    let place = |scene: &SceneId| out.join("licences").join(format!("{scene}.txt"));
    dataset.file.scenes.iter().try_for_each(|scene| write_one(dataset, scene, &place(scene)))
}
