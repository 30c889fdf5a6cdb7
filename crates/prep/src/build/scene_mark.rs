//! What a build notes of a scene that it has made, so that a later one need not make it again.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_scene::build_folder::BuildFolder;
use mateval_scene::dataset::{Licence, SceneFile, SourceFile};
use mateval_scene::layout::SceneFolder;
use mateval_scene::{SceneId, json, manifest};
use serde::{Deserialize, Serialize};

use crate::part_labels;
use crate::recipe::{Recipe, RecipeScene};

/// The file that a finished scene leaves in the build folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SceneMark {
    /// The hash of the recipe's settings for the scene, and of the tool that made it.
    pub(crate) settings_sha256: String,
    pub(crate) licence: Option<Licence>,
    /// Files that were looked for but do not exist, with paths as in `scene.json`.
    pub(super) absent: Vec<String>,
    /// All files in the folders of labels, whether used or not.
    pub(super) labels: BTreeSet<PathBuf>,
}

/// The mark of a scene that an earlier run made from the same files: none has changed, and none has been added since.
pub(super) fn finished_scene(root: &Path, entry: &RecipeScene, source: &Path) -> Option<SceneMark> {
    let mark: SceneMark = json::read(&BuildFolder::of(root).mark(&entry.id)).ok()?;
    let scene: SceneFile = json::read(&SceneFolder::of(root, &entry.id).scene_file()).ok()?;
    let root = entry.root(source);
    let is_same = |file: &SourceFile| manifest::sha256_of_file(&root.join(&file.path)).is_ok_and(|h| h == file.sha256);
    let is_absent = |file: &String| !root.join(file).exists();
    let same = scene.source.files.iter().all(is_same) && mark.absent.iter().all(is_absent);
    (same && mark.labels == label_files(entry, source)).then_some(mark)
}

/// The files in the folders of a scene's labels.
pub(super) fn label_files(entry: &RecipeScene, source: &Path) -> BTreeSet<PathBuf> {
    let files = |folder: &PathBuf| {
        // A folder that cannot be listed fails where it is read.
        let names = part_labels::file_names(&entry.root(source).join(folder)).unwrap_or_default();
        names.into_iter().map(|name| folder.join(name)).collect::<Vec<_>>()
    };
    entry.part_labels.values().flat_map(files).collect()
}

/// The hash of everything but files that decides how the scene of this id is made. `recipe` is as written.
pub(crate) fn settings_sha256(recipe: &Recipe, id: &SceneId, tool: &str) -> String {
    // Every setting is printed with all its fields; other scenes, the dataset's name and the renderer's samples are not
    // among them. The text is read by nobody, and the tool's version stands in it.
    let Recipe {
        name: _,
        version: _,
        resolution,
        views,
        wide,
        atlas_size,
        materials,
        camera_rules,
        samples: _,
        scenes,
    } = recipe;
    let entry = scenes.iter().find(|entry| entry.id == *id);
    let settings = format!(
        "{tool}\n{resolution:?}\n{views:?}\n{wide:?}\n{atlas_size:?}\n{materials:?}\n{camera_rules}\n{entry:?}"
    );
    manifest::sha256_of_bytes(settings.as_bytes())
}
